// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/cloud_mask.hpp"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <optional>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/core/point_cloud.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::sensing {
namespace {

// What nanoflann asks of a set of points.
struct Placed {
  const Points& at_m;
  std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(at_m.rows()); }
  double kdtree_get_pt(std::size_t point, std::size_t axis) const { return at_m(static_cast<Index>(point), static_cast<Index>(axis)); }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Placed>, Placed, 3, Index>;

/// Every n-th, so that no more than `most` are left.
std::vector<Index> thinned(const std::vector<Index>& points, double most) {
  const auto stride = static_cast<std::size_t>(std::max(1.0, std::ceil(static_cast<double>(points.size()) / most)));
  std::vector<Index> out;
  for (std::size_t i = 0; i < points.size(); i += stride) out.push_back(points[i]);
  return out;
}

/// Of the neighbours' heights above a plane. Not of the point's own: what stays would else know its own noise.
class HeightsAround {
 public:
  HeightsAround(const Points& points_m, int neighbours) : points_{points_m}, count_(static_cast<std::size_t>(neighbours) + 1) {}

  double median_m(Index point, const VectorX& heights_m) {
    if (!tree_) tree_.emplace(3, points_);
    found_.resize(count_);
    squared_m2_.resize(count_);
    const Vec3 at = points_.at_m.row(point);
    const std::size_t found = tree_->knnSearch(at.data(), count_, found_.data(), squared_m2_.data());
    around_.clear();
    for (std::size_t k = 0; k < found; ++k)
      if (found_[k] != point) around_.push_back(heights_m(found_[k]));
    if (around_.empty()) return heights_m(point);
    const auto middle = around_.begin() + static_cast<std::ptrdiff_t>(around_.size() / 2);
    std::nth_element(around_.begin(), middle, around_.end());
    return *middle;
  }

 private:
  Placed points_;
  std::size_t count_;
  std::optional<Tree> tree_;
  std::vector<Index> found_;
  std::vector<double> squared_m2_, around_;
};

}  // namespace

PointCloud points_of_object(const PointCloud& cloud, const std::vector<Plane>& planes, const Vec3& low_m, const Vec3& high_m,
                            const CloudMaskOptions& options) {
  check(options.planes);
  if (options.neighbours < 0) throw Error("must not be negative", "CloudMaskOptions.neighbours");
  if (!(options.most_points >= 1)) throw Error("must be at least 1", "CloudMaskOptions.most_points");
  demand_sigmas(cloud);
  const Index count = static_cast<Index>(cloud.points_m.rows());
  std::vector<Index> left;
  for (Index i = 0; i < count; ++i) {
    const Vec3 point = cloud.points_m.row(i);
    if ((point.array() >= low_m.array()).all() && (point.array() <= high_m.array()).all()) left.push_back(i);
  }
  // Neighbours are asked for of what may stay; most of a table goes below.
  left = thinned(left, 8 * options.most_points);
  const PointCloud near = chosen_points(cloud, left);
  std::vector<char> stays(left.size(), 1);
  HeightsAround around(near.points_m, options.neighbours);
  for (const Plane& plane : planes) {
    const VectorX heights_m = (near.points_m.rowwise() - plane.point_m.transpose()) * plane.normal.normalized();
    for (std::size_t i = 0; i < left.size(); ++i) {
      if (!stays[i]) continue;
      const Index point = static_cast<Index>(i);
      const double sigma = sigma_of_m(near, point), margin_m = options.planes.margin_m + options.planes.sigmas * sigma;
      const bool doubtful = options.neighbours > 0 && std::abs(heights_m(point) - margin_m) < 6 * sigma;
      stays[i] = (doubtful ? around.median_m(point, heights_m) : heights_m(point)) >= margin_m;
    }
  }
  std::vector<Index> above;
  for (std::size_t i = 0; i < left.size(); ++i)
    if (stays[i]) above.push_back(left[i]);
  return chosen_points(cloud, thinned(above, options.most_points));
}

struct RobotInClouds::Link {
  geometry::TriangleTree surface;
  Vec3 low_m, high_m;
  explicit Link(const TriMesh& mesh)
      : surface(mesh), low_m(mesh.vertices_m.colwise().minCoeff()), high_m(mesh.vertices_m.colwise().maxCoeff()) {}

  bool is_near(const Vec3& point_m, double margin_m) const {
    return (point_m.array() >= low_m.array() - margin_m).all() && (point_m.array() <= high_m.array() + margin_m).all() &&
           surface.within(point_m, margin_m * margin_m);
  }
};

RobotInClouds::RobotInClouds(const RobotMask& robot, double margin_m) : robot_(robot), margin_m_(margin_m) {
  if (!(margin_m >= 0)) throw Error("must not be negative", "RobotInClouds.margin_m");
  for (std::size_t k = 0; k < robot.shaped_links().size(); ++k) links_.push_back(std::make_shared<const Link>(robot.link_mesh(k)));
}

PointCloud RobotInClouds::without_robot(const PointCloud& cloud, const std::vector<std::string>& joint_names,
                                        const std::vector<double>& joints_rad, const Pose& T_base_root) const {
  demand_sigmas(cloud);
  std::vector<char> shows_robot(static_cast<std::size_t>(cloud.points_m.rows()), 0);
  for (const RobotMask::PosedLink& link : robot_.known_links(joint_names, joints_rad)) {
    const Pose T_link_base = (T_base_root * link.T_root_link).inverse();
    const double place_m = margin_m_ + 2 * std::hypot(link.position_std_m, cloud.pose_std_m);
    for (std::size_t i = 0; i < shows_robot.size(); ++i) {
      const Index point = static_cast<Index>(i);
      if (!shows_robot[i])
        shows_robot[i] = links_[link.shaped]->is_near(T_link_base * Vec3(cloud.points_m.row(point)), place_m + 3 * sigma_of_m(cloud, point));
    }
  }
  std::vector<Index> others;
  for (std::size_t i = 0; i < shows_robot.size(); ++i)
    if (!shows_robot[i]) others.push_back(static_cast<Index>(i));
  return chosen_points(cloud, others);
}

}  // namespace palpate::sensing
