// SPDX-License-Identifier: Apache-2.0
// CHOLMOD's supernodal Cholesky (Chen, Davis, Hager & Rajamanickam 2008) behind SparseFactor. In builds with
// PALPATE_WITH_CHOLMOD alone: that part of CHOLMOD is under the GPL, and so is what is linked with it.
#pragma once

#include <Eigen/SparseCore>
#include <memory>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::fem {

class CholmodFactor {
 public:
  /// @param position  of an unknown in the elimination order
  CholmodFactor(const Eigen::SparseMatrix<double>& lower, const std::vector<Index>& position);
  ~CholmodFactor();
  CholmodFactor(const CholmodFactor&) = delete;
  CholmodFactor& operator=(const CholmodFactor&) = delete;

  /// False when a pivot is not positive, or no more than rounding.
  bool factorise(const Eigen::SparseMatrix<double>& lower);
  void solve_in_place(Eigen::Ref<MatrixX> right_hand_sides) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::fem
