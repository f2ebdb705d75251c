// SPDX-License-Identifier: Apache-2.0
// Small groups of neighbouring nodes: the order of block rows, the pieces that threads share out, and the coarse unknowns.
#pragma once

#include <vector>

#include "palpate/core/math.hpp"
#include "palpate/fem/linear_solver/elimination_order.hpp"

namespace palpate::fem {

/// Where every unknown of a matrix acts: displacement of point_m along the unit vector `direction` (both n x 3). Iterative
/// solvers build rigid motions from it.
struct UnknownPlacement {
  Points point_m;
  Points direction;
  bool empty() const { return point_m.rows() == 0; }
};

struct Aggregates {
  std::vector<Index> order;  ///< groups (nodes) of the quotient graph, aggregate after aggregate
  std::vector<Index> begin;  ///< offsets into `order`, one more than there are aggregates
  Index count() const { return static_cast<Index>(begin.size()) - 1; }
};

/// Halves the cloud of nodes across its longest side until at most `largest` nodes are left (recursive coordinate
/// bisection). Without placement: runs of `largest` nodes in the given order.
Aggregates aggregate(const QuotientGraph& graph, const UnknownPlacement& placement, Index largest);

}  // namespace palpate::fem
