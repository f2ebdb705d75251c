// SPDX-License-Identifier: Apache-2.0
// Symbolic side of a multifrontal factorisation P A P' = L D L' (Duff & Reid 1983; Liu, "The multifrontal method for sparse
// matrix solution", SIAM Review 34, 1992). A front is a dense trapezoid of `pivots` columns that are eliminated together;
// what elimination leaves for the rows below, its update, is added into the parent's front.
#pragma once

#include <Eigen/SparseCore>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::fem {

struct FrontTree {
  struct Front {
    Index first = 0;        ///< first pivot, in elimination order
    Index pivots = 0;       ///< k
    Index height = 0;       ///< m: pivots and the rows below them
    Index parent = -1;      ///< -1: root
    Index last_child = -1;  ///< children are walked from last to first through `previous_sibling`
    Index previous_sibling = -1;
    Index depth = 0;        ///< roots have 0
    std::size_t panel = 0;  ///< offset of the m x k panel of L in the factor's values, column-major, stride m
    std::size_t rows = 0;   ///< offset of the m - k rows below in `rows`
    std::size_t first_entry = 0, last_entry = 0;  ///< the matrix entries that start in this front
    std::size_t first_run = 0, last_run = 0;      ///< where this front's update goes in the parent's front
    double subtree_flops = 0;
    Index below() const { return height - pivots; }
  };
  struct Entry {
    Index source;          ///< index into the values of the matrix
    std::uint32_t target;  ///< offset inside the panel
  };
  /// Rows [from, from + length) of the update are rows [to, to + length) of the parent's front; a run never crosses the
  /// border between the parent's pivots and the rows below.
  struct Run {
    Index from, to, length;
  };

  Index size = 0;
  Eigen::Index entries_of_matrix = 0;
  std::vector<Index> position;  ///< position of an unknown in the elimination order
  std::vector<Front> fronts;    ///< children before parents
  std::vector<Index> rows;      ///< positions, ascending inside a front
  std::vector<Entry> entries;
  std::vector<Run> runs;
  std::size_t panel_values = 0;  ///< entries of L that are stored, zeros of merged fronts included
  double flops = 0;              ///< of one factorisation (a multiply-add counts two)
};

/// Orders, merges small fronts into their parents where that costs less than it saves, and maps the matrix's entries.
/// @param lower          lower triangle, column-major, compressed, sorted rows, diagonal present
/// @param largest_group  unknowns a node
FrontTree build_front_tree(const Eigen::SparseMatrix<double>& lower, int largest_group);

}  // namespace palpate::fem
