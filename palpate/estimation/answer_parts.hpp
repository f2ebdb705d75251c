// SPDX-License-Identifier: Apache-2.0
// From a posterior and an optimum to the numbers of an answer.
#pragma once

#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/answer_shift.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/estimation/own_poisson.hpp"
#include "palpate/estimation/posterior.hpp"

namespace palpate::estimation {

/// E of a region, its median and interval; determined where log E's standard deviation is below 0.5.
Parameter young_from(const Posterior& posterior, const std::string& region);

/// nu; determined where less than 60 % of its prior's standard deviation is left.
/// @param region  whose it is; empty: the whole object's
Parameter ratio_from(const Posterior& posterior, const Unknown& nu, const std::string& region = {});

/// E of the first region, nu, E of the others, and their own nu where they have it.
/// @param names  of the regions; empty: there is one
std::vector<Parameter> parameters_from(const std::vector<Posterior>& regions, const OwnPoisson& own, const Unknowns& unknowns,
                                       const std::vector<std::string>& names);

/// (log E of the first region, nu, log E of the others), in the order of the parameters.
MatrixX covariance_of(const std::vector<Posterior>& regions);

/// An error that all regions share: each gets as wide as it makes it, and their correlation holds its products.
/// @param regions  the first one holds the correlation
void widen_together(std::vector<Posterior>& regions, const AnswerShift& shift, double poisson_lower, double poisson_upper);

/// The same for the rows of regions' own nu, whose variances hold these errors already; unchanged where there are none.
/// @param covariance  of all parameters  @param others  of them, that come before the regions' own nu
MatrixX with_shared(MatrixX covariance, Index others, const std::vector<AnswerShift>& errors);

/// Every nuisance with its normal interval and pull; the rest surface's error is one of them (its rms over the surface) where a
/// prediction holds its field.
/// @param covariance  of the unknowns `moving`
std::vector<Nuisance> nuisances_from(const Objective& objective, const Optimum& optimum, const MatrixX& covariance,
                                     const std::vector<int>& moving);

/// Used points, rms and chi-square per degree of freedom, priors included. Counts of steps and solves are the caller's.
FitSummary summary_of(const Unknowns& unknowns, const Optimum& optimum, const ResidualSummary& residuals);

}  // namespace palpate::estimation
