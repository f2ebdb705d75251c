// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/keep_out.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate::acquisition {

KeepOut keep_out(const Points& surface_m, std::vector<Plane> planes) {
  return {surface_m.colwise().minCoeff().transpose(), surface_m.colwise().maxCoeff().transpose(), std::move(planes)};
}

std::optional<KeepOut> keep_out(const Recording& scene) {
  if (scene.rest.surface && scene.rest.surface->vertices_m.rows() > 0)
    return keep_out(scene.rest.surface->vertices_m, scene.environment.planes);
  if (scene.rest.volume && scene.rest.volume->nodes_m.rows() > 0)
    return keep_out(scene.rest.volume->nodes_m, scene.environment.planes);
  return std::nullopt;
}

KeepOut grown(KeepOut around, double by_m) {
  around.min_m.array() -= by_m;
  around.max_m.array() += by_m;
  return around;
}

bool passes_through(const KeepOut& around, const Vec3& from_m, const Vec3& to_m) {
  constexpr double touching_m = 1e-9;
  double enters = 0, leaves = 1;  // shares of the line (Kay and Kajiya 1986)
  for (int i = 0; i < 3; ++i) {
    const double low = around.min_m(i) + touching_m, high = around.max_m(i) - touching_m, along = to_m(i) - from_m(i);
    if (std::abs(along) < 1e-15) {
      if (from_m(i) <= low || from_m(i) >= high) return false;
      continue;
    }
    const double a = (low - from_m(i)) / along, b = (high - from_m(i)) / along;
    enters = std::max(enters, std::min(a, b));
    leaves = std::min(leaves, std::max(a, b));
  }
  return enters < leaves;
}

double way_out_m(const KeepOut& around, const Vec3& from_m, const Vec3& direction) {
  if (!passes_through(around, from_m, from_m)) return 0;
  double leaves_m = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i)
    if (direction(i) != 0)
      leaves_m = std::min(leaves_m, ((direction(i) > 0 ? around.max_m(i) : around.min_m(i)) - from_m(i)) / direction(i));
  return leaves_m;
}

}  // namespace palpate::acquisition
