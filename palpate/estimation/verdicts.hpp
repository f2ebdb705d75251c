// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/cross_check.hpp"
#include "palpate/estimation/objective.hpp"
#include "palpate/estimation/optimise.hpp"

namespace palpate::estimation {

struct VerdictInput {
  const Recording& recording;
  Objective& objective;
  const Optimum& optimum;
  const ResidualSummary& residuals;
  const Identification& answer;  ///< parameters, nuisances and fit are filled
  const CrossChecks& checks;     ///< empty where none were made
};

/// What the numbers mean, in plain words; codes are stable and listed in docs/uncertainty.md.
std::vector<Verdict> judge(const VerdictInput& input);

}  // namespace palpate::estimation
