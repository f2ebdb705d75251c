// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/box_rims.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "palpate/geometry/union_find.hpp"

namespace palpate::geometry {
namespace {

using Segment = std::pair<Vec3, Vec3>;

// What of a segment lies in the box.
std::optional<Segment> within(const Vec3& low, const Vec3& high, const Segment& s) {
  const Vec3 way = s.second - s.first;
  double from = 0, to = 1;
  for (int k = 0; k < 3; ++k) {
    if (way(k) == 0) {
      if (s.first(k) < low(k) || s.first(k) > high(k)) return {};
      continue;
    }
    const double a = (low(k) - s.first(k)) / way(k), b = (high(k) - s.first(k)) / way(k);
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  if (from >= to) return {};
  return Segment(s.first + from * way, s.first + to * way);
}

// Where a triangle goes through the plane in which one coordinate has a value.
std::optional<Segment> through(int axis, double at, const std::array<Vec3, 3>& corner) {
  std::vector<Vec3> ends;
  for (int k = 0; k < 3; ++k) {
    const Vec3 &a = corner[std::size_t(k)], &b = corner[std::size_t((k + 1) % 3)];
    if ((a(axis) < at) == (b(axis) < at)) continue;
    Vec3 end = a + (at - a(axis)) / (b(axis) - a(axis)) * (b - a);
    end(axis) = at;
    ends.push_back(end);
  }
  if (ends.size() != 2) return {};
  return Segment(ends[0], ends[1]);
}

}  // namespace

std::vector<FinerNear> finer_at_rims(const Vec3& box_min_m, const Vec3& box_max_m, const TriMesh& surface) {
  UnionFind together(surface.vertices_m.rows());  // triangles that share a vertex are of one rim
  std::vector<std::pair<Index, Segment>> pieces;  // a vertex of the triangle, and where that goes through
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    std::array<Vec3, 3> corner;
    for (int k = 0; k < 3; ++k) corner[std::size_t(k)] = surface.vertices_m.row(surface.triangles(t, k));
    bool of_a_rim = false;
    for (int axis = 0; axis < 3; ++axis)
      for (const double at : {box_min_m(axis), box_max_m(axis)}) {
        const auto line = through(axis, at, corner);
        const auto piece = line ? within(box_min_m, box_max_m, *line) : std::nullopt;
        if (!piece) continue;
        pieces.emplace_back(surface.triangles(t, 0), *piece);
        of_a_rim = true;
      }
    for (int k = 1; of_a_rim && k < 3; ++k) together.join(surface.triangles(t, 0), surface.triangles(t, k));
  }
  std::map<Index, std::vector<Segment>> rims;
  for (const auto& [vertex, piece] : pieces) rims[together.root(vertex)].push_back(piece);

  constexpr double share = 0.12;
  std::vector<FinerNear> finer;
  for (const auto& [root, rim] : rims) {
    double length_m = 0;
    for (const auto& [a, b] : rim) length_m += (b - a).norm();
    const double edge_m = share * length_m / (2 * std::sqrt(EIGEN_PI));
    const std::size_t first = finer.size();
    for (const auto& [a, b] : rim) {
      const int steps = 1 + int((b - a).norm() / (0.7 * edge_m));
      for (int k = 0; k <= steps; ++k) {
        const Vec3 at = a + double(k) / steps * (b - a);
        const bool known = std::any_of(finer.begin() + std::ptrdiff_t(first), finer.end(),
                                       [&](const auto& one) { return (one.point_m - at).norm() < 0.7 * edge_m; });
        if (!known) finer.push_back({at, 0.7 * edge_m, edge_m});
      }
    }
  }
  return finer;
}

}  // namespace palpate::geometry
