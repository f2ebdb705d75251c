// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/foreign_points.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <unordered_map>

#include "palpate/core/point_cloud.hpp"
#include "palpate/geometry/union_find.hpp"
#include "palpate/reconstruction/facets.hpp"

namespace palpate::reconstruction {
namespace {

constexpr double near_share = 0.15;  // of the body's size
constexpr double far_share = 1;       // the same: beyond it a few points are of no use either, and make the cells wide for all others
constexpr double least_share = 0.02;  // of all points
constexpr double infinity = std::numeric_limits<double>::infinity();

/// Points in cubic cells, and which of these hang together by faces, edges or corners.
class Clusters {
 public:
  Clusters(const std::vector<PointCloud>& clouds, double cell_m) : cell_m_(cell_m) {
    for (const PointCloud& cloud : clouds)
      for (Index i = 0; i < cloud.points_m.rows(); ++i) {
        const Vec3 point = cloud.points_m.row(i);
        cell_of_point_.push_back(point.allFinite() ? cell_at(point) : -1);
        if (cell_of_point_.back() >= 0) ++points_[static_cast<std::size_t>(cell_of_point_.back())];
      }
    geometry::UnionFind joined(static_cast<Eigen::Index>(cells_.size()));
    for (std::size_t c = 0; c < cells_.size(); ++c)
      for (int x = -1; x <= 1; ++x)
        for (int y = -1; y <= 1; ++y)
          for (int z = -1; z <= 1; ++z)
            if (const auto other = index_.find(key_of({cells_[c][0] + x, cells_[c][1] + y, cells_[c][2] + z})); other != index_.end())
              joined.join(static_cast<Index>(c), other->second);
    for (std::size_t c = 0; c < cells_.size(); ++c) {
      root_.push_back(joined.root(static_cast<Index>(c)));
      members_[root_.back()].push_back(static_cast<Index>(c));
    }
  }

  double cell_m() const { return cell_m_; }
  /// Cells of each cluster.
  const std::map<Index, std::vector<Index>>& members() const { return members_; }
  Vec3 middle_m(Index cell) const {
    const Cell& at = cells_[static_cast<std::size_t>(cell)];
    return cell_m_ * Vec3(static_cast<double>(at[0]) + 0.5, static_cast<double>(at[1]) + 0.5, static_cast<double>(at[2]) + 0.5);
  }
  /// -1: no cell is so near.
  Index nearest_to(const Vec3& point_m, double within_m) const {
    Index nearest = -1;
    double least_m2 = within_m * within_m;
    for (std::size_t c = 0; c < cells_.size(); ++c) {
      const double away_m2 = (middle_m(static_cast<Index>(c)) - point_m).squaredNorm();
      if (away_m2 < least_m2) least_m2 = away_m2, nearest = root_[c];
    }
    return nearest;
  }
  std::size_t points_of(Index cluster) const {
    std::size_t sum = 0;
    for (const Index c : members_.at(cluster)) sum += points_[static_cast<std::size_t>(c)];
    return sum;
  }
  /// Of the n-th point of all clouds; -1: of one that is not finite.
  Index cluster_of(std::size_t point) const {
    return cell_of_point_[point] < 0 ? -1 : root_[static_cast<std::size_t>(cell_of_point_[point])];
  }

 private:
  Index cell_at(const Vec3& point_m) {
    const Cell cell{std::int64_t(std::floor(point_m.x() / cell_m_)), std::int64_t(std::floor(point_m.y() / cell_m_)),
                    std::int64_t(std::floor(point_m.z() / cell_m_))};
    const auto [at, fresh] = index_.try_emplace(key_of(cell), static_cast<Index>(cells_.size()));
    if (fresh) cells_.push_back(cell), points_.push_back(0);
    return at->second;
  }

  double cell_m_;
  std::vector<Cell> cells_;
  std::vector<std::size_t> points_;  // a cell
  std::unordered_map<Key, Index> index_;
  std::vector<Index> cell_of_point_, root_;
  std::map<Index, std::vector<Index>> members_;
};

/// Width of a cell as for fusing (fuse_views), twice as wide so that cells of one surface meet; 0: there is nothing.
double cell_for(const std::vector<PointCloud>& clouds) {
  Vec3 low = Vec3::Constant(infinity), high = -low;
  double sigma_m = 0;
  for (const PointCloud& cloud : clouds) {
    for (Index i = 0; i < cloud.points_m.rows(); ++i)
      if (const Vec3 point = cloud.points_m.row(i); point.allFinite()) low = low.cwiseMin(point), high = high.cwiseMax(point);
    if (cloud.sigma_m.size() > 0) sigma_m = std::max(sigma_m, cloud.sigma_m.mean());
  }
  return (low.array() <= high.array()).all() ? 2 * std::max(2.2 * sigma_m, (high - low).norm() / 150) : 0;
}

/// One round: the foreign clusters, and how near those come that are more than noise.
std::set<Index> foreign_clusters(const Clusters& clusters, std::size_t all_points, const std::vector<Touch>& touched, double& nearest_m) {
  std::set<Index> body_clusters, foreign;
  // A side that no view shows may be touched, too: what is nearest to it may be something else.
  for (const Touch& touch : touched)
    if (const Index cluster = clusters.nearest_to(touch.point_m, 2 * clusters.cell_m() + touch.radius_m); cluster >= 0)
      body_clusters.insert(cluster);
  if (body_clusters.empty()) return foreign;
  std::vector<Vec3> body;
  Vec3 low = Vec3::Constant(infinity), high = -low;
  for (const Index cluster : body_clusters)
    for (const Index cell : clusters.members().at(cluster)) {
      body.push_back(clusters.middle_m(cell));
      low = low.cwiseMin(body.back()), high = high.cwiseMax(body.back());
    }
  for (const auto& [cluster, cells] : clusters.members()) {
    if (body_clusters.count(cluster) != 0) continue;
    const bool few = static_cast<double>(clusters.points_of(cluster)) < least_share * static_cast<double>(all_points);
    double least_m = infinity;
    for (const Index cell : cells)
      for (const Vec3& own : body) least_m = std::min(least_m, (clusters.middle_m(cell) - own).norm());
    if (least_m < (few ? far_share : near_share) * (high - low).norm()) continue;
    foreign.insert(cluster);
    if (!few) nearest_m = std::min(nearest_m, least_m);
  }
  return foreign;
}

}  // namespace

ForeignPoints drop_foreign(std::vector<PointCloud>& clouds, const std::vector<Touch>& touched) {
  std::size_t all = 0, dropped = 0;
  for (const PointCloud& cloud : clouds) all += static_cast<std::size_t>(cloud.points_m.rows());
  double nearest_m = infinity;
  // Far things make cells wide, in which near ones hang together: once the far ones are gone, again.
  constexpr int most_rounds = 5;
  for (int round = 0; round < most_rounds && !touched.empty(); ++round) {
    const double cell_m = cell_for(clouds);
    if (!(cell_m > 0)) break;
    const Clusters clusters(clouds, cell_m);
    double near_m = infinity;
    const std::set<Index> foreign = foreign_clusters(clusters, all, touched, near_m);
    if (foreign.empty()) break;
    nearest_m = std::min(nearest_m, near_m);
    std::size_t point = 0;
    for (PointCloud& cloud : clouds) {
      std::vector<Index> stay;
      for (Index i = 0; i < cloud.points_m.rows(); ++i)
        if (foreign.count(clusters.cluster_of(point++)) == 0) stay.push_back(i);
      dropped += std::isfinite(near_m) ? static_cast<std::size_t>(cloud.points_m.rows()) - stay.size() : 0;
      cloud = chosen_points(cloud, stay);
    }
  }
  return {all > 0 ? static_cast<double>(dropped) / static_cast<double>(all) : 0, dropped > 0 ? nearest_m : 0};
}

}  // namespace palpate::reconstruction
