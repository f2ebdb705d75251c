// SPDX-License-Identifier: Apache-2.0
// What a recording states as exactly known and the residuals may speak against: where and how wide a tool touches, whether the
// foot holds and its support stands firm, that the object is the same everywhere.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/estimation/site_stiffness.hpp"
#include "palpate/estimation/solve_count.hpp"
#include "palpate/estimation/step_checks.hpp"

namespace palpate::estimation {

/// Chances at which a difference between parts of a recording is said, and at which something that was stated is doubted.
inline constexpr double rare = 0.01, very_rare = 0.001;

/// Another value that the residuals ask for, all else of the fit free under its priors (the score test of one added unknown).
struct Doubt {
  enum class About { contact, tool_radius, support, support_compliance };
  About about = About::contact;
  std::string name;    ///< of the push, the tool or the support
  std::vector<int> unknowns;  ///< of the wider model that asked
  double size_m = 0;   ///< contact: how far aside; tool: wider (below zero: narrower); support: how far its rim slides outwards;
                       ///< support_compliance: how much more it gives way than stated, m/N
  double scale_m = 0;  ///< contact and tool: the tool's radius; support: radius of its rim; compliance: as stated, m/N
  double chi2 = 0;     ///< by how much it would fall
  double p_value = 1;  ///< chance of asking for as much where everything is as stated, over all that was asked
  VectorX log_young = VectorX::Zero(1);  ///< what it would do to log E, of every region
  double poisson = 0;                    ///< and to nu
};

struct Doubts {
  std::vector<Doubt> all;          ///< the one that explains most first
  std::optional<StepChange> slip;  ///< of contacts that are stated as exactly known (see contact_slip)
  std::optional<Slip> unrecorded_slip;  ///< that explains more than any of `all` (see find_slip)
  std::optional<SiteStiffness> sites;  ///< where several places were pushed and no regions are given
  std::vector<BudgetEntry> budget_if;  ///< what is stated as exactly known, were it off by a typical size
};

/// One evaluation at the optimum with everything unknown that is stated as exactly known, from the fit's own equilibria. Bodies that lift
/// off or are touched by rigid tools are solved anew, since their solutions cannot be handed over, and nothing but `budget_if` is asked of them.
/// @param inputs  what `objective` was made of
/// @param factor  information factor of robust rows
/// @param misfit  chi2 per degree of freedom, where it is above one
/// @param took    what the wider model is solved for is added
/// @param solved  used and filled, for another fit of the same object that is touched in the same way; nullptr: nothing is kept
Doubts look_for_doubts(const Recording& recording, const Objective& objective, const Optimum& optimum, const Inputs& inputs,
                       const FitOptions& options, double factor, double misfit, const OnProgress& progress,
                       SolveCount& took, std::shared_ptr<ForwardModel::Solved>* solved = nullptr);

}  // namespace palpate::estimation
