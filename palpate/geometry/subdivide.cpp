// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/subdivide.hpp"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

namespace palpate::geometry {

TriMesh subdivided(TriMesh surface, double edge_m) {
  constexpr Index most = 60000;
  const auto longest_m = [&] {
    double longest = 0;
    for (Index t = 0; t < surface.triangles.rows(); ++t) {
      for (int k = 0; k < 3; ++k) {
        longest = std::max(longest, (surface.vertices_m.row(surface.triangles(t, k)) -
                                     surface.vertices_m.row(surface.triangles(t, (k + 1) % 3)))
                                        .norm());
      }
    }
    return longest;
  };
  while (4 * surface.triangles.rows() <= most && longest_m() > edge_m) {
    std::map<std::pair<Index, Index>, Index> middle_of;
    std::vector<Eigen::RowVector3d> added;
    const Index before = static_cast<Index>(surface.vertices_m.rows());
    const auto middle = [&](Index a, Index b) {
      const auto [it, fresh] = middle_of.emplace(std::minmax(a, b), before + static_cast<Index>(added.size()));
      if (fresh) added.push_back(0.5 * (surface.vertices_m.row(a) + surface.vertices_m.row(b)));
      return it->second;
    };
    Triangles finer(4 * surface.triangles.rows(), 3);
    for (Index t = 0; t < surface.triangles.rows(); ++t) {
      const Index a = surface.triangles(t, 0), b = surface.triangles(t, 1), c = surface.triangles(t, 2);
      const Index ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.middleRows<4>(4 * t) << a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca;
    }
    surface.triangles = std::move(finer);
    surface.vertices_m.conservativeResize(before + static_cast<Index>(added.size()), 3);
    for (std::size_t k = 0; k < added.size(); ++k) surface.vertices_m.row(before + static_cast<Index>(k)) = added[k];
  }
  return surface;
}

}  // namespace palpate::geometry
