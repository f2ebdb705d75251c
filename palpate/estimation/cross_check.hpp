// SPDX-License-Identifier: Apache-2.0
// Do the parts of a recording agree? E of single pushes, of low and high loads, of loading and unloading, all at the joint fit's
// nu; and prediction of pushes that the fit has not seen.
#pragma once

#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/partial_fit.hpp"

namespace palpate::estimation {

struct CrossChecks {
  std::vector<PartialYoung> pushes;             ///< empty where there is one push only
  std::vector<PartialYoung> sites;              ///< pushes at one place together; empty where there is one place only
  PartialYoung low_loads, high_loads;           ///< usable where pushes have levels
  /// Quarters of every push's highest load, the lightest first; empty where low and high loads agree, or loads are in fewer than three.
  std::vector<PartialYoung> quarters;
  PartialYoung loading, unloading;              ///< usable where steps were recorded on the way back
  /// That parts which have one E differ by at least as much; 1 where there is nothing to compare.
  double chance_of_pushes = 1, chance_of_loads = 1, chance_of_ways = 1;
  HeldOut held_out;
  bool cancelled = false;
};

/// Refits parts of the recording from the joint optimum. The objective's last evaluation is the optimum's when it starts, and
/// when it ends.
/// @param factor       information factor of robust rows
/// @param poisson_std  to which the joint fit knows nu
CrossChecks cross_check(Objective& objective, const Optimum& optimum, const Loss& loss, double factor, double poisson_std,
                        const OnProgress& progress);

}  // namespace palpate::estimation
