// SPDX-License-Identifier: Apache-2.0
// Answers of a linear body to unit loads over nu, every one of them solved by CalculiX: a few Poisson ratios and a polynomial between
// them, so that many recordings of known truth cost no solve each.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::coverage {

/// The polynomial in z = -log(1 - 2 nu) through Chebyshev's points (Berrut and Trefethen 2004, eq. 4.2 and 5.3): displacements are
/// smooth in z up to nu = 0.5, where they are not in nu.
class CalculixResponse {
 public:
  using Solve = std::function<MatrixX(double poisson)>;

  CalculixResponse(const Solve& solve, double poisson_lower, double poisson_upper, int points) {
    const double low = z_of(poisson_lower), high = z_of(poisson_upper);
    for (int i = 0; i < points; ++i) {
      const double angle = (2 * i + 1) * EIGEN_PI / (2 * points);
      z_.push_back(0.5 * (low + high) + 0.5 * (high - low) * std::cos(angle));
      weight_.push_back((i % 2 ? -1 : 1) * std::sin(angle));
      answer_.push_back(solve(poisson_of(z_.back())));
    }
    // Half way between two points is where a polynomial errs most.
    for (int i : {0, points / 2, points - 2}) {
      const double nu = poisson_of(0.5 * (z_[static_cast<std::size_t>(i)] + z_[static_cast<std::size_t>(i) + 1]));
      const MatrixX truth = solve(nu);
      error_ = std::max(error_, (at(nu) - truth).cwiseAbs().maxCoeff() / truth.cwiseAbs().maxCoeff());
    }
  }

  MatrixX at(double poisson) const {
    const double z = z_of(poisson);
    MatrixX sum = MatrixX::Zero(answer_[0].rows(), answer_[0].cols());
    double weights = 0;
    for (std::size_t i = 0; i < z_.size(); ++i) {
      if (z == z_[i]) return answer_[i];
      const double weight = weight_[i] / (z - z_[i]);
      sum += weight * answer_[i];
      weights += weight;
    }
    return sum / weights;
  }

  /// Largest difference to CalculiX itself at ratios between, relative to the largest answer.
  double error() const { return error_; }

 private:
  static double z_of(double poisson) { return -std::log(1 - 2 * poisson); }
  static double poisson_of(double z) { return 0.5 * (1 - std::exp(-z)); }

  std::vector<double> z_, weight_;
  std::vector<MatrixX> answer_;
  double error_ = 0;
};

}  // namespace palpate::coverage
