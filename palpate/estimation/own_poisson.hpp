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

/// @param covariance  of the unknowns `moving`, nu among them
OwnPoisson own_poisson(const Unknowns& unknowns, const VectorX& optimum, const MatrixX& covariance, const std::vector<int>& moving);

/// The highest nu of all regions.
double highest_poisson(const Unknowns& unknowns, const VectorX& at);

/// A normal number that is known to lie between two bounds, as a Poisson ratio of a region.
Parameter cut_normal(double mean, double std, double lower, double upper, const std::string& region);

}  // namespace palpate::estimation
