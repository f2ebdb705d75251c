// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/homogeneity.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace palpate::estimation {

double homogeneity_p_value(const VectorX& log_moduli, MatrixX covariance) {
  if (log_moduli.size() < 2) return 1;
  covariance.diagonal().array() += contact_model_std * contact_model_std;
  const Eigen::LDLT<MatrixX> factorised(covariance);
  const VectorX ones = VectorX::Ones(log_moduli.size()), weights = factorised.solve(ones);
  const double mean = weights.dot(log_moduli) / weights.sum();
  const VectorX off = log_moduli - mean * ones;
  return chi_square_tail(off.dot(factorised.solve(off)), static_cast<int>(log_moduli.size()) - 1);
}

double chi_square_tail(double value, int degrees_of_freedom) {
  if (!(value > 0)) return 1;
  // Regularised incomplete gamma function Q(k/2, x/2): recurrence upwards from k = 1 or 2 (Abramowitz and Stegun 26.4.6-7).
  const double half = 0.5 * value;
  const bool odd = degrees_of_freedom % 2 == 1;
  double tail = odd ? std::erfc(std::sqrt(half)) : std::exp(-half);
  double term = odd ? 2 * std::sqrt(half / EIGEN_PI) * std::exp(-half) : half * std::exp(-half);
  for (int k = odd ? 3 : 4; k <= degrees_of_freedom; k += 2) {
    tail += term;
    term *= half / (0.5 * k);
  }
  return std::min(tail, 1.0);
}

}  // namespace palpate::estimation
