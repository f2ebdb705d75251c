// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/SparseCore>
#include <memory>

#include "palpate/core/math.hpp"

namespace palpate::fem {

/// Direct factorisation of a symmetric sparse matrix; one symbolic analysis serves a whole fit.
class SparseFactor {
 public:
  struct Options {
    bool indefinite = false;  ///< LDL' with signs (tangents past a limit point); false: Cholesky
    int block = 3;            ///< unknowns a node: the ordering works on nodes (set 1 when the matrix has no block structure)
    int threads = 1;
  };
  SparseFactor();
  explicit SparseFactor(Options options);
  ~SparseFactor();
  SparseFactor(SparseFactor&&) noexcept;
  SparseFactor& operator=(SparseFactor&&) noexcept;

  /// Ordering and symbolic analysis of the lower triangle's pattern (column-major, sorted rows, diagonal present).
  void analyse(const Eigen::SparseMatrix<double>& lower);

  /// Numeric factorisation of a matrix with the analysed pattern. False when a Cholesky pivot is not positive.
  bool factorise(const Eigen::SparseMatrix<double>& lower);

  /// Solves in place, many right-hand sides together.
  void solve_in_place(Eigen::Ref<MatrixX> right_hand_sides) const;

  int negative_pivots() const;  ///< of the last factorisation (indefinite mode)

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::fem
