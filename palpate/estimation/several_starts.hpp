// SPDX-License-Identifier: Apache-2.0
// What a search from several starts came to: how many there were, which minima they ended at, and whether the data tell these apart.
#pragma once

#include <string>
#include <vector>

#include "palpate/estimation/optimise.hpp"

namespace palpate::estimation {

/// Where a search ended.
struct Minimum {
  double log_young = 0, poisson = 0;
  double cost = 0;  ///< by the one loss that all of them are compared by: half of a chi-square and what priors add
};

struct Starts {
  int tried = 0;
  std::vector<Minimum> minima;  ///< that differ, lowest first
  double scale = 1;             ///< of the residuals at the lowest one, in stated standard deviations, at least 1
};

/// Sorts what the searches ended at and leaves out what lies in one valley: within two standard deviations of a lower one, in log E
/// and in nu, for data whose residuals are `scale` times what is stated.
std::vector<Minimum> distinct_minima(std::vector<Minimum> found, double log_young_std, double poisson_std, double scale);

/// The minima beside the lowest one that noise could have made the lowest: twice the difference of their costs is below the 95 %
/// quantile of a chi-square of two degrees of freedom, in squares of `scale`.
std::vector<Minimum> hardly_told_apart(const Starts& starts);

/// "3 (from the first one the model did not fit); minima: E 12.3 kPa, nu 0.310, cost 345.2; E 48.1 kPa, ..."
std::string to_words(const Starts& starts);

/// As optimise_from_several; `starts` is filled.
Optimum optimise_from_several(Objective& objective, const VectorX& start, const Loss& final_loss, const OptimiseOptions& options,
                              const OnProgress& progress, Starts& starts);

}  // namespace palpate::estimation
