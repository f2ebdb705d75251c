// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/unknowns.hpp"

namespace palpate::estimation {

/// How much each group of nuisances adds to the uncertainty: the part of the variance of log E and nu that vanishes when the
/// group is taken as known, as a standard deviation (in per cent of E, and of nu). Ordered by its share in E.
/// @param hessian  of the unknowns `moving` (log E first), priors included
/// @param regions  their names, where there are several
std::vector<BudgetEntry> error_budget(const Unknowns& unknowns, const MatrixX& hessian, const std::vector<int>& moving,
                                      const std::vector<std::string>& regions);

/// The same information where nu's bounds cut its distribution: nu's standard deviation is what is left of it, so that no entry of
/// the budget can be larger than the interval that it is a part of.
/// @param information  of the unknowns `moving`
MatrixX with_bounded_poisson(MatrixX information, const std::vector<int>& moving, double poisson_std);

/// The largest share in any region's E first.
void sort_by_share(std::vector<BudgetEntry>& budget);

/// Per cent of the E of every region as the first one's and, where there are several, by name.
void set_young(BudgetEntry& entry, const VectorX& percent, const std::vector<std::string>& regions);

/// log E of every region out of the unknowns `moving`, one a row: that of the first one, and a ratio's on top of it.
MatrixX log_young_of_regions(const Unknowns& unknowns, const std::vector<int>& moving);

}  // namespace palpate::estimation
