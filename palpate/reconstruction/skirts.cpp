// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/skirts.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/reconstruction/flank.hpp"

namespace palpate::reconstruction {
namespace {

constexpr double step_cells = 0.8;
constexpr double same_place_cells = 0.7;
constexpr double steepest_normal = 0.8;  // along the plane's normal: flatter parts have no way down
constexpr double least_upright = 0.95;   // the same of a flank on its way down: flatter, it would run along the plane
constexpr double smooth_cells = 4;       // over which a flank tells how it goes on

PointCloud middles_of(const std::vector<Facet>& facets) {
  PointCloud out;
  out.points_m.resize(static_cast<Index>(facets.size()), 3), out.normals.resize(static_cast<Index>(facets.size()), 3);
  for (std::size_t i = 0; i < facets.size(); ++i)
    out.points_m.row(static_cast<Index>(i)) = facets[i].middle.transpose(), out.normals.row(static_cast<Index>(i)) = facets[i].normal.transpose();
  return out;
}

/// Of the normals along the plane over what they would come to if they looked one way.
double one_sided(const std::vector<Facet>& facets, const Vec3& up) {
  Vec3 sum = Vec3::Zero();
  double all = 0;
  for (const Facet& f : facets) {
    const Vec3 along = f.normal - f.normal.dot(up) * up;
    sum += f.area_m2 * along, all += f.area_m2 * along.norm();
  }
  return all > 0 ? sum.norm() / all : 1;
}

}  // namespace

bool seen_from_all_around(const std::vector<Facet>& seen, const std::optional<Plane>& plane, double height_m) {
  constexpr double even = 0.15, even_below = 0.35;  // the strip above the table is thin, and legs hide each other
  const Vec3 up = plane ? plane->normal : Vec3(Vec3::UnitZ());
  if (!plane) return one_sided(seen, up) < even && one_sided(seen, up.unitOrthogonal()) < even;
  std::vector<Facet> low;
  for (const Facet& f : seen)
    if (up.dot(f.middle - plane->point_m) < height_m && std::abs(up.dot(f.normal)) < steepest_normal) low.push_back(f);
  return one_sided(seen, up) < even && one_sided(low, up) < even_below;
}

std::vector<Facet> skirts(const std::vector<Facet>& seen, const Plane& plane, double height_m, double cell_m,
                          const std::function<bool(const Vec3&)>& free) {
  const Grid grid({middles_of(seen)}, smooth_cells * cell_m);
  const auto height = [&](const Vec3& p) { return plane.normal.dot(p - plane.point_m); };
  std::vector<Facet> out;
  const auto covered = [&](const Vec3& p, const Vec3& normal) {
    const double least2 = std::pow(same_place_cells * cell_m, 2);
    return grid.any_around(p, [&](Index i) { return (grid.point(i) - p).squaredNorm() < least2 && grid.normal(i).dot(normal) > 0.3; }) ||
           std::any_of(out.begin(), out.end(), [&](const Facet& f) { return (f.middle - p).squaredNorm() < least2 && f.normal.dot(normal) > 0.3; });
  };
  for (const Facet& from : seen) {
    if (height(from.middle) > height_m) continue;
    if (std::abs(plane.normal.dot(from.normal)) > steepest_normal) continue;
    const Flank flank = flank_below(from, plane.normal, grid, cell_m, smooth_cells);
    Vec3 at = flank.at_m;
    for (double gone_m = step_cells * cell_m;; gone_m += step_cells * cell_m) {
      const Vec3 halfway = flank.normal_at(gone_m - 0.5 * step_cells * cell_m), normal = flank.normal_at(gone_m);
      const double along = plane.normal.dot(halfway);
      if (std::abs(along) > least_upright) break;  // it has turned to the plane, or away from it
      at += step_cells * cell_m * (along * halfway - plane.normal).normalized();
      if (height(at) < -0.5 * step_cells * cell_m || covered(at, normal) || (free && free(at))) break;
      out.push_back({at, normal, from.area_m2, from.sigma_m});
    }
  }
  return out;
}

}  // namespace palpate::reconstruction
