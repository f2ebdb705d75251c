// SPDX-License-Identifier: Apache-2.0
// Poisson ratios that further regions have for themselves. The first region's is the one that the posterior is explored over; these
// are normal given all that was measured, and cut at their bounds.
#pragma once

#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/answer_shift.hpp"
#include "palpate/estimation/optimise.hpp"

namespace palpate::estimation {

struct OwnPoisson {
  VectorX mean, std;    ///< a further region; empty: they share one
  MatrixX correlation;  ///< of all parameters, in the order of an answer: log E of the first, nu, log E of the others, their nu

  void move(const AnswerShift& shift);
  void widen(const AnswerShift& shift);
  /// Medians and intervals, one a further region. @param names  of all regions
  std::vector<Parameter> parameters(const Unknowns& unknowns, const std::vector<std::string>& names) const;
  /// Borders the covariance of all that comes before these. Unchanged where there are none.
  MatrixX covariance_with(const MatrixX& others) const;
};

/// @param covariance  of the unknowns `moving`, nu among them, bounds left out. Means of those held at a bound are what the data say without it.
OwnPoisson own_poisson(const Unknowns& unknowns, const Optimum& optimum, const MatrixX& covariance, const std::vector<int>& moving);

/// The highest nu of all regions.
double highest_poisson(const Unknowns& unknowns, const VectorX& at);

/// A normal number that is known to lie between two bounds, as a Poisson ratio of a region.
Parameter cut_normal(double mean, double std, double lower, double upper, const std::string& region);

/// Log of the share of a normal distribution that lies between bounds, over its density at `at`, the place between them that is likeliest,
/// times that of a standard one: what is left of an integral that the height at `at` and the width stand for.
/// @param beyond  how far outside its middle lies; 0: at `at`
double log_share_in_range(double at, double beyond, double std, double lower, double upper);

}  // namespace palpate::estimation
