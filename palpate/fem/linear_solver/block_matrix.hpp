// SPDX-License-Identifier: Apache-2.0
// Symmetric matrix as rows of 3 x 3 blocks, both triangles stored, for fast products with a vector. Nodes that lost unknowns
// to supports are filled up with ones on the diagonal, so that every block is whole: vectors live in `padded` numbering.
#pragma once

#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

#include "palpate/core/math.hpp"
#include "palpate/fem/linear_solver/elimination_order.hpp"
#include "palpate/fem/linear_solver/large_array.hpp"

namespace palpate::fem {

class BlockMatrix {
 public:
  /// @param lower  lower triangle (its pattern is kept, its values are not read)
  /// @param graph  of `lower` with groups of at most three unknowns
  /// @param order  the groups in the order of the block rows
  BlockMatrix(const Eigen::SparseMatrix<double>& lower, const QuotientGraph& graph, const std::vector<Index>& order);

  /// @param values  of a lower triangle with the same pattern
  void set_values(const double* values);

  Index block_rows() const { return static_cast<Index>(begin_.size()) - 1; }
  Eigen::Index padded_size() const { return 3 * static_cast<Eigen::Index>(block_rows()); }
  std::size_t block_count() const { return column_.size(); }

  /// Padded position of every unknown.
  const std::vector<Index>& padded() const { return padded_; }

  /// y = A x for block rows [first, last). x and y are padded.
  void multiply(const double* x, double* y, Index first, Index last) const;

  Mat3 diagonal_block(Index row) const;

  /// Blocks of a row: columns ascending.
  const std::vector<Index>& begin() const { return begin_; }
  const std::vector<Index>& columns() const { return column_; }
  const double* block(Index entry) const {
    return values_.data() + 9 * static_cast<std::ptrdiff_t>(entry);
  }  ///< column-major

 private:
  std::vector<Index> padded_, begin_, column_, diagonal_;
  struct Target {
    std::uint32_t direct, mirrored;  // offsets in values_
  };
  LargeVector<Target> targets_;  // of every entry of the lower triangle
  LargeVector<double> values_;   // column-major blocks, and one number more for the last wide load
};

}  // namespace palpate::fem
