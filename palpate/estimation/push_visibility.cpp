// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/push_visibility.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "palpate/estimation/grazing.hpp"
#include "palpate/estimation/load_columns.hpp"

namespace palpate::estimation {
namespace {

constexpr double stick_margin_m = 0.002;

/// Distance of a segment from a ray that ends after length_m (Ericson, Real-Time Collision Detection, 5.1.9).
double segment_distance_m(const Vec3& from, const Vec3& along, double range_m, const Vec3& start, const Vec3& axis,
                          double length_m) {
  const Vec3 apart = from - start;
  const double b = along.dot(axis), c = along.dot(apart), f = axis.dot(apart), denominator = 1 - b * b;
  double s = denominator > 1e-12 ? std::clamp((b * f - c) / denominator, 0.0, range_m) : 0;
  double t = b * s + f;
  if (t < 0 || t > length_m) {
    t = std::clamp(t, 0.0, length_m);
    s = std::clamp(b * t - c, 0.0, range_m);
  }
  return (from + s * along - start - t * axis).norm();
}

}  // namespace

RayObservation without_stick(const RayObservation& view, const PushCandidate& candidate, double radius_m, double length_m) {
  std::vector<Index> keep;
  for (Index i = 0; i < view.rays.range_m.size(); ++i) {
    if (segment_distance_m(view.rays.origins_m.row(i), view.rays.directions.row(i), view.rays.range_m(i),
                           candidate.contact_m, -candidate.direction, length_m) > radius_m + stick_margin_m)
      keep.push_back(i);
  }
  RayObservation out = view;
  out.rays.origins_m = view.rays.origins_m(keep, Eigen::all);
  out.rays.directions = view.rays.directions(keep, Eigen::all);
  out.rays.range_m = view.rays.range_m(keep);
  out.rays.sigma_m = view.rays.sigma_m(keep);
  if (view.rays.pixel.rows() > 0) out.rays.pixel = view.rays.pixel(keep, Eigen::all);
  return out;
}

double seen_share(const geometry::TriangleTree& surface, const Points& seen_m, const std::optional<Vec3>& eye_m,
                  const PushCandidate& candidate, double radius_m, double spacing) {
  constexpr int turns = 12;
  const auto across = tangents(candidate.direction);
  const double near_m = std::max(0.6 * radius_m, 2 * spacing);
  const auto shows = [&](const Vec3& around, bool measured) {
    const auto on = surface.closest(around);
    if (eye_m) {
      const auto corner = [&](int k) {
        return Vec3(surface.mesh().vertices_m.row(surface.mesh().triangles(on.triangle, k)));
      };
      const Vec3 normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
      const Vec3 towards = on.point_m - *eye_m;
      if (-normal.dot(towards) < grazing_cosine * towards.norm()) return false;
      const auto hit = surface.cast(*eye_m, towards.normalized());
      if (hit && hit->range_m < towards.norm() - 0.1 * radius_m) return false;
    }
    return !measured || (seen_m.rowwise() - on.point_m.transpose()).rowwise().squaredNorm().minCoeff() < near_m * near_m;
  };
  // What presses on a hidden side may well move what is seen, but nobody would see it slip.
  if (!shows(candidate.contact_m, false)) return 0;
  int seen = 0, all = 0;
  for (const double ring : {1.3, 2.0, 2.7}) {
    for (int k = 0; k < turns; ++k, ++all) {
      const double angle = 2 * EIGEN_PI * k / turns;
      seen +=
          shows(candidate.contact_m + ring * radius_m * (std::cos(angle) * across[0] + std::sin(angle) * across[1]), true);
    }
  }
  return static_cast<double>(seen) / all;
}

}  // namespace palpate::estimation
