// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/surface_edges.hpp"

#include <algorithm>
#include <tuple>

namespace palpate::geometry {

std::vector<SurfaceEdge> surface_edges(const Triangles& triangles) {
  std::vector<SurfaceEdge> sides;  // of one triangle each
  sides.reserve(static_cast<std::size_t>(3 * triangles.rows()));
  for (Index t = 0; t < triangles.rows(); ++t)
    for (Index k = 0; k < 3; ++k) {
      const Index a = triangles(t, k), b = triangles(t, (k + 1) % 3);
      sides.push_back({std::min(a, b), std::max(a, b), {t, -1}});
    }
  const auto key = [](const SurfaceEdge& side) { return std::tie(side.from, side.to, side.triangles[0]); };
  std::sort(sides.begin(), sides.end(), [&](const SurfaceEdge& a, const SurfaceEdge& b) { return key(a) < key(b); });
  std::vector<SurfaceEdge> edges;
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t next = i + 1;
    while (next < sides.size() && sides[next].from == sides[i].from && sides[next].to == sides[i].to) ++next;
    edges.push_back(sides[i]);
    if (next == i + 2) edges.back().triangles[1] = sides[i + 1].triangles[0];
    i = next;
  }
  return edges;
}

}  // namespace palpate::geometry
