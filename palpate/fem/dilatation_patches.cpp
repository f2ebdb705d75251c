// SPDX-License-Identifier: Apache-2.0
// Where the volume change is averaged: continuous linear pressures of quadratic tetrahedra, patches of linear ones. A linear
// tetrahedron has too few unknowns for a constraint of its own, so those around a node share one (compare the F-bar patches
// of de Souza Neto, Pires and Owen 2005).
#include <algorithm>

#include "palpate/core/error.hpp"
#include "palpate/fem/assembly.hpp"
#include "palpate/fem/tetrahedron.hpp"

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
  patches_.resize(group_linear_elements(connectivity_, nodes_, patch_of_));
  for (Index e = 0; e < count; ++e) {
    Patch& patch = patches_[patch_of_[e]];
    for (int a = 0; a < 4; ++a) patch.nodes.push_back(connectivity_(e, a));
    patch.volume += weights_[e];
  }
  for (Patch& patch : patches_) {
    std::sort(patch.nodes.begin(), patch.nodes.end());
    patch.nodes.erase(std::unique(patch.nodes.begin(), patch.nodes.end()), patch.nodes.end());
  }
  slot_.resize(static_cast<std::size_t>(count) * 4);
  for (Index e = 0; e < count; ++e) {
    const auto& all = patches_[patch_of_[e]].nodes;
    for (int a = 0; a < 4; ++a)
      slot_[static_cast<std::size_t>(e) * 4 + a] =
          static_cast<Index>(std::lower_bound(all.begin(), all.end(), connectivity_(e, a)) - all.begin());
  }
}

void Assembly::build_pressures(const TetMesh& mesh) {
  std::vector<Index> number(nodes_, -1);
  for (Index e = 0; e < element_count(); ++e)
    for (int a = 0; a < 4; ++a) {
      Index& p = number[mesh.tetrahedra(e, a)];
      if (p < 0) p = pressures_++;
      pressure_of_.push_back(p);
    }
  pattern_.nodes = nodes_ + pressures_;
  factorise_pressure_mass();
}

void Assembly::factorise_pressure_mass() const {
  std::vector<Eigen::Triplet<double>> triplets;
  const auto quadrature = tet_quadrature_4();
  for (Index e = 0; e < element_count(); ++e)
    for (int q = 0; q < 4; ++q)
      for (int a = 0; a < 4; ++a)
        for (int b = 0; b < 4; ++b) {
          const Index i = pressure_of_[4 * static_cast<std::size_t>(e) + a],
                      j = pressure_of_[4 * static_cast<std::size_t>(e) + b];
          if (i >= j)
            triplets.emplace_back(
                i, j,
                bulk_weight(e) * weights_[4 * static_cast<std::size_t>(e) + q] * quadrature[q].barycentric(a) * quadrature[q].barycentric(b));
        }
  Eigen::SparseMatrix<double> mass(pressures_, pressures_);
  mass.setFromTriplets(triplets.begin(), triplets.end());
  mass_factor_ = SparseFactor({false, 1, 1});
  mass_factor_.analyse(mass);
  if (!mass_factor_.factorise(mass)) throw Error("its elements are too distorted for pressures at the corners", "mesh");
}

}  // namespace palpate::fem
