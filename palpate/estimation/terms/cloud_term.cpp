// SPDX-License-Identifier: Apache-2.0
// Points of a cloud against the closest point of the deformed surface (point to triangle, never nearest vertex: that is biased
// by the mesh's spacing). The whole boundary is searched, not only the part that sensors see: noise carries points over the
// edge of the seen part, and clipping there would pull the surface outwards.
#include <cmath>
#include <optional>

#include "palpate/core/error.hpp"
#include "palpate/estimation/terms/surface_terms.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {
namespace {

class CloudTerm : public Term {
 public:
  CloudTerm(const PointCloud& cloud, std::shared_ptr<const geometry::TriangleTree> rest, int pose, int camera)
      : points_m_(cloud.points_m),
        pose_(pose),
        camera_(camera),
        rest_tree_(std::move(rest)),
        rest_(rest_tree_->mesh()),
        hints_(static_cast<std::size_t>(cloud.points_m.rows()), -1) {
    sigma_m_ = cloud.sigma_m.size() == 1 ? VectorX::Constant(points_m_.rows(), cloud.sigma_m(0)).eval() : cloud.sigma_m;
    centre_m_ = points_m_.colwise().mean();
    middle_m_ = rest_.vertices_m.colwise().mean();
    typical_ = sigma_m_.mean();
    // Neighbours may err together: cells of a tenth of the object.
    const double cell_m = 0.1 * (rest_.vertices_m.colwise().maxCoeff() - rest_.vertices_m.colwise().minCoeff()).norm();
    for (Index i = 0; i < points_m_.rows(); ++i) {
      const Eigen::Array3d at = ((points_m_.row(i).transpose() - centre_m_) / cell_m).array().floor() + 512;
      cell_.push_back(static_cast<int>(at(0)) + 1024 * (static_cast<int>(at(1)) + 1024 * static_cast<int>(at(2))));
    }
  }

  TermRows rows(const StepPrediction& predicted, const VectorX& unknowns, const TermView& view) const override {
    if (!tree_) tree_.emplace(*rest_tree_);
    tree_->refit(predicted.surface_m);
    const RigidMap frame = frame_pose(unknowns, pose_, centre_m_), camera = frame_pose(unknowns, camera_, middle_m_);
    const Index count = static_cast<Index>(predicted.columns.size());
    TermRows rows;
    rows.unknowns = predicted.columns;
    for (int unknown : own_unknowns()) rows.unknowns.push_back(unknown);
    const FieldColumns field(predicted);
    field.append_unknowns(rows.unknowns);
    rows.jacobian.setZero(points_m_.rows(), static_cast<Index>(rows.unknowns.size()));
    rows.residual.resize(points_m_.rows());
    rows.sigma = sigma_m_;
    rows.cell = cell_;
    rows.observed_m.resize(points_m_.rows(), 3);
    rows.met_m.resize(points_m_.rows(), 3);
    rows.robust = true;
    rows.unit = "m";
    if (view.surface_slopes) rows.surface.resize(static_cast<std::size_t>(points_m_.rows()));
    const MatrixX slopes = predicted.d_surface.transpose();  // a vertex's in one place
    VectorX slope(count);
    for (Index i = 0; i < points_m_.rows(); ++i) {
      const Vec3 seen = camera.apply(points_m_.row(i)), point = frame.apply(seen);
      if (!view.asks(i, static_cast<Index>(points_m_.rows()))) {
        rows.residual(i) = std::numeric_limits<double>::infinity();
        continue;
      }
      const auto hit = tree_->closest(point, hints_[static_cast<std::size_t>(i)]);
      hints_[static_cast<std::size_t>(i)] = hit.triangle;
      const auto triangle = rest_.triangles.row(hit.triangle);
      const auto corner = [&](int k) { return Vec3(predicted.surface_m.row(triangle(k))); };
      Vec3 normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
      const Vec3 apart = point - hit.point_m;
      const double side = normal.dot(apart) < 0 ? -1 : 1;
      // The distance grows along `apart`; on the surface itself that direction is the face's normal.
      if (apart.norm() > 1e-9) normal = side * apart.normalized();
      rows.residual(i) = side * apart.norm() / sigma_m_(i);
      slope.setZero();
      for (int k = 0; k < 3; ++k)
        slope.noalias() -= slopes.middleCols<3>(3 * triangle(k)) * (hit.barycentric(k) / sigma_m_(i) * normal);
      rows.jacobian.row(i).head(count) = slope.transpose();
      field.subtract(rows.jacobian, i, triangle, hit.barycentric, normal / sigma_m_(i));
      if (pose_ >= 0) rows.jacobian.row(i).segment<6>(count) = frame.slope(normal / sigma_m_(i), seen);
      if (camera_ >= 0)
        rows.jacobian.row(i).segment<6>(count + (pose_ >= 0 ? 6 : 0)) =
            camera.slope(frame.rotation().transpose() * normal / sigma_m_(i), points_m_.row(i));
      rows.observed_m.row(i) = point;
      rows.met_m.row(i) = hit.point_m;
      if (view.surface_slopes)
        rows.surface[static_cast<std::size_t>(i)] = {hit.triangle, -normal / sigma_m_(i) * hit.barycentric.transpose()};
    }
    return rows;
  }
  std::vector<int> own_unknowns() const override {
    std::vector<int> own;
    for (int k = 0; pose_ >= 0 && k < 6; ++k) own.push_back(pose_ + k);
    for (int k = 0; camera_ >= 0 && k < 6; ++k) own.push_back(camera_ + k);
    return own;
  }
  double typical_sigma() const override { return typical_; }

 private:
  Points points_m_;
  VectorX sigma_m_;
  std::vector<int> cell_;
  Vec3 centre_m_ = Vec3::Zero(), middle_m_ = Vec3::Zero();  // of the cloud and of the object
  double typical_ = 0;
  int pose_, camera_;  // unknowns of this cloud and of all of its camera's, along the base frame's axes: a cloud says no others
  std::shared_ptr<const geometry::TriangleTree> rest_tree_;
  const TriMesh& rest_;
  mutable std::optional<geometry::TriangleTree> tree_;  // refitted to the surface that is asked about; none yet: never asked
  mutable std::vector<Index> hints_;     // last closest triangles: they only make the search faster
};

}  // namespace

std::unique_ptr<Term> make_cloud_term(const PointCloud& cloud, const TermContext& context) {
  const std::string where = context.model.step(context.step).source + " cloud";
  if (cloud.points_m.rows() == 0) throw Error("no point of the cloud shows the object: none is near it and above tables and walls", where);
  if (cloud.sigma_m.size() != 1 && cloud.sigma_m.size() != cloud.points_m.rows()) {
    throw Error("give one standard deviation (sigma_m), or one a point", where);
  }
  if (!(cloud.sigma_m.minCoeff() > 0)) throw Error("sigma_m must be positive", where);
  return std::make_unique<CloudTerm>(cloud, context.model.rest_tree(),
                                     add_frame_pose(context, cloud.pose_std_m, cloud.pose_std_rad),
                                     add_camera_pose(context, cloud.camera, cloud.pose_std_m, cloud.pose_std_rad));
}

}  // namespace palpate::estimation
