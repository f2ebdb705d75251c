// SPDX-License-Identifier: Apache-2.0
// Patches over which the volume change is averaged. A quadratic tetrahedron is its own patch (P2/P0). A linear one has too
// few unknowns for a constraint of its own, so the tetrahedra around a node share one (compare the F-bar patches of de Souza
// Neto, Pires and Owen 2005).
#include <algorithm>

#include "palpate/fem/assembly.hpp"

namespace palpate::fem {
namespace {

// Patch of every element; returns their number.
Index group_linear_elements(const Tetrahedra& elements, Index node_count, std::vector<Index>& patch_of) {
  const Index count = static_cast<Index>(elements.rows());
  patch_of.assign(count, -1);
  std::vector<std::vector<Index>> around(node_count);
  for (Index e = 0; e < count; ++e)
    for (int a = 0; a < 4; ++a) around[elements(e, a)].push_back(e);
  // Balls around nodes that share no element, largest first.
  std::vector<Index> order(node_count);
  for (Index i = 0; i < node_count; ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return around[a].size() > around[b].size(); });
  Index patches = 0;
  std::vector<Index> size;
  for (Index node : order) {
    const auto& ball = around[node];
    if (ball.size() < 4 || std::any_of(ball.begin(), ball.end(), [&](Index e) { return patch_of[e] >= 0; })) continue;
    for (Index e : ball) patch_of[e] = patches;
    size.push_back(static_cast<Index>(ball.size()));
    ++patches;
  }
  // What is left joins the smallest patch that shares most nodes with it.
  for (bool joined = true; joined;) {
    joined = false;
    for (Index e = 0; e < count; ++e) {
      if (patch_of[e] >= 0) continue;
      Index best = -1;
      int best_shared = 0;
      for (int a = 0; a < 4; ++a)
        for (Index other : around[elements(e, a)]) {
          const Index p = patch_of[other];
          if (p < 0) continue;
          int shared = 0;
          for (int b = 0; b < 4; ++b)
            for (int c = 0; c < 4; ++c) shared += elements(e, b) == elements(other, c);
          if (shared > best_shared || (shared == best_shared && best >= 0 && size[p] < size[best])) {
            best = p;
            best_shared = shared;
          }
        }
      if (best >= 0) {
        patch_of[e] = best;
        ++size[best];
        joined = true;
      }
    }
  }
  for (Index e = 0; e < count; ++e)  // parts of the mesh too small for a ball
    if (patch_of[e] < 0) patch_of[e] = patches++;
  return patches;
}

}  // namespace

void Assembly::build_patches() {
  const Index count = element_count();
  const int nodes = static_cast<int>(connectivity_.cols());
  const int points = nodes == 4 ? 1 : 4;
  Index patches = count;
  if (nodes == 4) {
    patches = group_linear_elements(connectivity_, pattern_.nodes, patch_of_);
  } else {
    patch_of_.resize(count);
    for (Index e = 0; e < count; ++e) patch_of_[e] = e;
  }
  patches_.resize(patches);
  for (Index e = 0; e < count; ++e) {
    Patch& patch = patches_[patch_of_[e]];
    for (int a = 0; a < nodes; ++a) patch.nodes.push_back(connectivity_(e, a));
    for (int q = 0; q < points; ++q) patch.volume += weights_[static_cast<std::size_t>(e) * points + q];
  }
  for (Patch& patch : patches_) {
    std::sort(patch.nodes.begin(), patch.nodes.end());
    patch.nodes.erase(std::unique(patch.nodes.begin(), patch.nodes.end()), patch.nodes.end());
  }
  slot_.resize(static_cast<std::size_t>(count) * nodes);
  for (Index e = 0; e < count; ++e) {
    const auto& all = patches_[patch_of_[e]].nodes;
    for (int a = 0; a < nodes; ++a)
      slot_[static_cast<std::size_t>(e) * nodes + a] =
          static_cast<Index>(std::lower_bound(all.begin(), all.end(), connectivity_(e, a)) - all.begin());
  }
}

}  // namespace palpate::fem
