// SPDX-License-Identifier: Apache-2.0
// Fill-reducing elimination order of a symmetric sparse pattern, found on its quotient graph: the unknowns of one node have
// the same neighbours, so ordering nodes instead of unknowns is nine times less work on three-dimensional elasticity.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::fem {

/// Groups of consecutive unknowns with the same neighbours, and the symmetric graph between groups (no loops).
struct QuotientGraph {
  std::vector<Index>
      first_unknown;             ///< group_count + 1 entries; group g holds unknowns [first_unknown[g], first_unknown[g+1])
  std::vector<Index> begin;      ///< group_count + 1 offsets into `neighbour`
  std::vector<Index> neighbour;  ///< sorted within a group
  Index group_count() const { return static_cast<Index>(first_unknown.size()) - 1; }
};

/// Collects up to `largest_group` consecutive unknowns into a group when their columns below the diagonal agree. Works for
/// nodes that have lost some of their unknowns to supports too.
/// @param lower  lower triangle, column-major, compressed, sorted rows, diagonal present
QuotientGraph quotient_graph(const Eigen::SparseMatrix<double>& lower, int largest_group);

/// The groups in the order in which to eliminate them: approximate minimum degree.
std::vector<Index> minimum_degree_order(const QuotientGraph& graph);

/// The groups in the order in which to eliminate them: nested dissection (METIS, fixed seed: the same graph gives the same
/// order).
std::vector<Index> nested_dissection_order(const QuotientGraph& graph);

}  // namespace palpate::fem
