// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <utility>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::coverage {

/// Every triangle near a place in four, until none there is longer.
inline TriMesh finer_near(TriMesh mesh, const Vec3& place_m, double radius_m, double edge_m, double elsewhere_m) {
  std::vector<Vec3> points;
  for (Index v = 0; v < mesh.vertices_m.rows(); ++v) points.push_back(mesh.vertices_m.row(v));
  std::vector<std::array<Index, 3>> triangles;
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    triangles.push_back({mesh.triangles(t, 0), mesh.triangles(t, 1), mesh.triangles(t, 2)});
  // Longest edges are halved, both of their triangles at once, so that no crack opens.
  for (bool again = true; again;) {
    again = false;
    std::map<std::pair<Index, Index>, Index> middle;
    const auto at = [&](Index i) -> const Vec3& { return points[static_cast<std::size_t>(i)]; };
    std::vector<std::pair<Index, Index>> longest;
    for (const auto& t : triangles) {
      std::pair<Index, Index> edge;
      double length_m = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const Index a = t[k], b = t[(k + 1) % 3];
        // Ties go to the lower pair of indices, so that neighbours agree.
        const double d = (at(a) - at(b)).norm();
        if (d > length_m * (1 + 1e-9)) length_m = d, edge = std::minmax(a, b);
      }
      longest.push_back(edge);
      const double away_m = std::max(0.0, ((at(t[0]) + at(t[1]) + at(t[2])) / 3 - place_m).norm() - radius_m);
      if (length_m > std::min(elsewhere_m, edge_m + 0.3 * away_m) && middle.emplace(edge, -1).second) again = true;
    }
    for (auto& [edge, node] : middle) {
      node = static_cast<Index>(points.size());
      points.push_back(0.5 * (at(edge.first) + at(edge.second)));
    }
    std::vector<std::array<Index, 3>> next;
    const auto split = [&](const auto& self, const std::array<Index, 3>& t) -> void {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto cut = middle.find(std::minmax(t[k], t[(k + 1) % 3]));
        if (cut == middle.end()) continue;
        self(self, {t[k], cut->second, t[(k + 2) % 3]});
        self(self, {cut->second, t[(k + 1) % 3], t[(k + 2) % 3]});
        return;
      }
      next.push_back(t);
    };
    for (const auto& t : triangles) split(split, t);
    triangles = std::move(next);
  }
  mesh.vertices_m.resize(static_cast<Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) mesh.vertices_m.row(static_cast<Index>(i)) = points[i];
  mesh.triangles.resize(static_cast<Index>(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i)
    mesh.triangles.row(static_cast<Index>(i)) << triangles[i][0], triangles[i][1], triangles[i][2];
  return mesh;
}

}  // namespace palpate::coverage
