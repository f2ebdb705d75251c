// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/cross_check.hpp"
#include "palpate/estimation/doubts.hpp"
#include "palpate/estimation/objective.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/estimation/posterior.hpp"
#include "palpate/estimation/several_starts.hpp"
#include "palpate/estimation/shape_error.hpp"

namespace palpate::estimation {

struct VerdictInput {
  const Recording& recording;
  Objective& objective;
  const Optimum& optimum;
  const ResidualSummary& residuals;
  const Identification& answer;  ///< parameters, nuisances and fit are filled
  const CrossChecks& checks;     ///< empty where none were made
  const Doubts& doubts;          ///< the same
  const std::optional<fem::Certificate>& certificate;  ///< of the hardest step; nothing where none was made
};

/// What the numbers mean, in plain words; codes are stable and listed in docs/uncertainty.md.
std::vector<Verdict> judge(const VerdictInput& input);

/// Where the search came to places that the data hardly tell apart; nothing where it did not.
std::optional<Verdict> several_minima(const Starts& starts);

/// Where no equilibrium was found at a Poisson ratio that the data do not exclude; nothing where all were.
std::optional<Verdict> nu_not_explored(const Posterior& posterior);

/// Of an object that was not seen from all sides.
Verdict partly_seen(const ShapeDoubt& doubt);

}  // namespace palpate::estimation
