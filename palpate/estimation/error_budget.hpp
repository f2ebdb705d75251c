// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/unknowns.hpp"

namespace palpate::estimation {

/// How much each group of nuisances adds to the uncertainty: the part of the variance of log E and nu that vanishes when the
/// group is taken as known, as a standard deviation (in per cent of E, and of nu). Ordered by its share in E.
/// @param hessian  of the unknowns `moving` (log E first), priors included
std::vector<BudgetEntry> error_budget(const Unknowns& unknowns, const MatrixX& hessian, const std::vector<int>& moving);

}  // namespace palpate::estimation
