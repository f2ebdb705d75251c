// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/young_bounds.hpp"

#include <cmath>
#include <vector>

namespace palpate::estimation {

double middle_of_bounds(const Unknown& unknown) { return 0.5 * (unknown.lower + unknown.upper); }
double std_of_bounds(const Unknown& unknown) { return (unknown.upper - unknown.lower) / std::sqrt(12.0); }

bool tells_young(const MatrixX& information, const Eigen::LDLT<MatrixX>& factorised, const Unknowns& unknowns) {
  constexpr double rounding = 1e-14;  // of what is said when all else is known: less of it left is none
  const double widest_std = 100 * std_of_bounds(unknowns[log_young]);
  // The factor goes past a pivot of zero: what nothing was said of comes out with a variance of zero, or below by rounding.
  const double variance = factorised.solve(VectorX::Unit(information.rows(), 0))(0);
  return std::isfinite(variance) && variance > 0 && variance < widest_std * widest_std && rounding * variance * information(0, 0) < 1;
}

double information_of_bounds(const Unknowns& unknowns) { return std::pow(std_of_bounds(unknowns[log_young]), -2); }

void bound_young(MatrixX& information, const Unknowns& unknowns) {
  std::vector<int> others;
  for (int k = 0; k < unknowns.size(); ++k)
    if (!unknowns[k].fixed && k != poisson) others.push_back(k);
  if (others.empty() || others.front() != log_young) return;
  const MatrixX given_poisson = information(others, others);
  if (!tells_young(given_poisson, Eigen::LDLT<MatrixX>(given_poisson), unknowns))
    information(log_young, log_young) += information_of_bounds(unknowns);
}

}  // namespace palpate::estimation
