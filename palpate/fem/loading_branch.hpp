// SPDX-License-Identifier: Apache-2.0
// A non-linear body along one branch of loads E t a0: u / t and du/da on a tensor grid of Chebyshev points in -log(1 - 2 nu)
// and t. Across a0 (a force that turns, a contact that shifts) answers are of first order.
#pragma once

#include <vector>

#include "palpate/fem/statics.hpp"

namespace palpate::fem {

class LoadingBranch {
 public:
  struct Options {
    double poisson_lower = 0, poisson_upper = 0.49;
    double tolerance = 1e-3;  ///< relative, of the last coefficients; more points are taken until it is met
    int max_solves = 160;
  };
  /// At one nu and F / E.
  struct Point {
    VectorX watched_m, d_poisson;  ///< r
    MatrixX d_force_over_young;    ///< r x k
    double across = 0;  ///< what the loads across a0 add, squared relative to the rest: the size of what is left out
  };

  /// @param force_over_young  k: a0, so that t = 1 is the end of the range
  LoadingBranch(const Statics& statics, const Eigen::SparseMatrix<double>& watched, const VectorX& force_over_young,
                Options options);

  /// False outside the grid, or where loads across a0 are no longer small.
  bool covers(double poisson_ratio, const VectorX& force_over_young) const;
  Point at(double poisson_ratio, const VectorX& force_over_young) const;

  double end() const {
    return end_;
  }  ///< largest t: below 1 where no equilibrium, or one with inverted elements, was found beyond
  double error() const { return error_; }  ///< relative
  int solves() const { return solves_; }

 private:
  bool fill(int poissons, int loads);
  double along(const VectorX& force_over_young) const;

  const Statics& statics_;
  const Eigen::SparseMatrix<double>& watched_;
  VectorX direction_;
  Options options_;
  double end_ = 1, error_ = 0;
  int solves_ = 0, poissons_ = 0, loads_ = 0;
  std::vector<MatrixX> coefficients_;  // of T_i(z) T_j(t): r x (1 + k), [u / t, du / d(a / E)]
};

}  // namespace palpate::fem
