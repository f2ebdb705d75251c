// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/make_room.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "palpate/geometry/tet_quality.hpp"

namespace palpate::geometry {
namespace {

constexpr int most_sweeps = 6;
constexpr double first_step = 0.1, last_step = 0.005;  // of the longest edge of an element beside the node

double longest_edge_m(const TetMesh& mesh, Index t) {
  double longest2 = 0;
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < i; ++k)
      longest2 = std::max(longest2, (mesh.nodes_m.row(mesh.tetrahedra(t, i)) - mesh.nodes_m.row(mesh.tetrahedra(t, k))).squaredNorm());
  return std::sqrt(longest2);
}

/// Looks along the axes for a place where the worst of the elements around the node is better, with shorter and shorter steps.
void to_best_place(Index node, const std::vector<Index>& around, TetMesh& volume) {
  const auto worst = [&] {
    double least = 1;
    for (const Index t : around) least = std::min(least, tet_quality(volume, t));
    return least;
  };
  const double size_m = longest_edge_m(volume, around.front());
  double best = worst();
  for (double step_m = first_step * size_m; step_m > last_step * size_m;) {
    const Vec3 from = volume.nodes_m.row(node);
    bool better = false;
    for (int way = 0; way < 6 && !better; ++way) {
      volume.nodes_m.row(node) = (from + (way % 2 == 0 ? step_m : -step_m) * Vec3::Unit(way / 2)).transpose();
      const double now = worst();
      better = now > best;
      if (better) best = now;
      else volume.nodes_m.row(node) = from.transpose();
    }
    if (!better) step_m *= 0.5;
  }
}

}  // namespace

void make_room(const Triangles& faces, const Points& before, double least_quality, TetMesh& volume) {
  std::vector<char> outer(static_cast<std::size_t>(volume.nodes_m.rows()));
  for (Index t = 0; t < faces.rows(); ++t)
    for (int k = 0; k < 3; ++k) outer[faces(t, k)] = 1;
  std::vector<std::vector<Index>> around(outer.size());
  for (Index t = 0; t < volume.tetrahedra.rows(); ++t)
    for (int k = 0; k < 4; ++k) around[volume.tetrahedra(t, k)].push_back(t);
  const TetMesh old{before, volume.tetrahedra};
  for (int sweep = 0; sweep < most_sweeps; ++sweep) {
    std::set<Index> inner;
    for (Index t = 0; t < volume.tetrahedra.rows(); ++t) {
      const double now = tet_quality(volume, t);
      if (now >= least_quality || now >= tet_quality(old, t)) continue;
      for (int k = 0; k < 4; ++k)
        if (!outer[volume.tetrahedra(t, k)]) inner.insert(volume.tetrahedra(t, k));
    }
    if (inner.empty()) return;
    for (const Index i : inner) to_best_place(i, around[i], volume);
  }
}

}  // namespace palpate::geometry
