// SPDX-License-Identifier: Apache-2.0
// Reduced model of a linear material: what is watched of the body (surface, tool travel, reactions) as a function of nu.
// Exact in E and in the loads, a polynomial in z = -log(1 - 2 nu) that matches values and derivatives at a few Poisson
// ratios.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "palpate/fem/response_span.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {

/// May be asked by several threads at once; one of them solves while the others wait.
class LinearResponse {
 public:
  struct Options {
    double poisson_lower = 0,
           poisson_upper = 0.49;  ///< the polynomial's range; outside of it, or where both are equal, each is solved for
    double tolerance = 1e-7;      ///< of the polynomial's own error, relative to the column's largest watched value
    int max_factorisations = 24;
    double memory_limit_bytes = 1e9;  ///< of the polynomial; beyond it every ratio is solved for
    double field_limit_bytes = 0;     ///< of a second one, of the whole displacement; beyond it there is no displacement_m()
  };

  /// @param statics  of a linear material; must outlive this object, and is used by it alone
  /// @param watched  r x 3n: rows that are wanted of the displacement
  LinearResponse(const Statics& statics, Eigen::SparseMatrix<double> watched, Options options);

  /// Answers at one nu, solved for or interpolated.
  std::shared_ptr<const UnitResponses> at(double poisson_ratio) const;

  /// Fields that the first `rows` watched rows of all answers are sums of; always for the same `rows`. nullptr: the polynomial was
  /// not needed yet, or does not reach this ratio.
  std::shared_ptr<const ResponseSpan> span(Index rows, double poisson_ratio) const;
  /// What at() says of the watched rows from `first_row` on, where span() has an answer.
  UnitResponses rows_from(Index first_row, double poisson_ratio) const { return interpolate(poisson_ratio, first_row); }

  /// The displacement of all nodes, 3n, without a solve. nullopt: its polynomial is not made, too large, or does not reach this ratio.
  /// @param force_over_young  k: coefficients over E  @param motion  m
  std::optional<VectorX> displacement_m(double poisson_ratio, const VectorX& force_over_young, const VectorX& motion) const;

  /// Of the polynomial, relative: the larger of its last coefficients and what the solver left over (0: not made).
  double interpolation_error() const;
  int factorisations() const;
  /// Right-hand sides solved so far: unit loads and their slopes.
  int load_cases() const;

 private:
  UnitResponses solve(double poisson_ratio, const Eigen::SparseMatrix<double>& watched) const;
  void make_polynomial() const;
  UnitResponses interpolate(double poisson_ratio, Index first_row) const;

  const Statics& statics_;
  Eigen::SparseMatrix<double> watched_;
  Options options_;
  mutable std::mutex mutex_;
  mutable std::vector<std::shared_ptr<const UnitResponses>> recent_;  // latest last
  mutable int factorisations_ = 0, load_cases_ = 0;
  mutable bool usable_ = true;                 // false: the polynomial would be too large, or not accurate enough
  mutable std::vector<MatrixX> coefficients_;  // of T_i: [watched; reactions of forces and motions; gradients] x (k + m)
  mutable std::vector<MatrixX> field_;         // of T_i: 3n x (k + m)
  mutable std::shared_ptr<const ResponseSpan> span_;
  mutable double error_ = 0, residual_ = 0;
};

}  // namespace palpate::fem
