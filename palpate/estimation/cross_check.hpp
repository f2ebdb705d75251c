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
  StepFlags low_steps, high_steps;              ///< what they are made of, with the unloaded steps
  PartialYoung loading, unloading;              ///< usable where steps were recorded on the way back
  HeldOut held_out;
  bool cancelled = false;
};

/// Refits parts of the recording from the joint optimum. The objective's last evaluation is the optimum's when it starts, and
/// when it ends.
/// @param factor  information factor of robust rows
CrossChecks cross_check(Objective& objective, const Optimum& optimum, const Loss& loss, double factor, const OnProgress& progress);

/// Of log E between contacts: patch and pressure are idealised.
inline constexpr double contact_model_std = 0.02;

/// Cochran's Q test that parts share one E: chance of differences at least as large (Cochran 1954). Each part's variance holds
/// its own noise, what nu's uncertainty does to it apart from the others, and 2 % for the tool's contact, which no part knows.
/// @returns 1 for fewer than two usable parts
double homogeneity_p_value(const std::vector<PartialYoung>& parts, double poisson_std);

/// Upper tail of the chi-square distribution.
double chi_square_tail(double value, int degrees_of_freedom);

}  // namespace palpate::estimation
