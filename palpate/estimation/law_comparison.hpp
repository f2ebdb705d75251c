// SPDX-License-Identifier: Apache-2.0
// Laws of elasticity on the same data, mesh, weights and rays: which of them predicts the highest loads from the lower ones?
#pragma once

#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/optimise.hpp"

namespace palpate::estimation {

struct LawComparison {
  std::vector<LawFit> laws;  ///< the fitted one, and those of linear, neo_hookean and foam that it is not
  bool cancelled = false;
};

/// Every law is fitted once more, from the optimum, and once without the highest load of each push; both with few iterations, so
/// that the whole costs no more than some fits. The mesh is taken as it is: its error is about the same for all laws.
/// @param object    of the fit; its law comes first
/// @param unknowns  and optimum of that fit
LawComparison compare_laws(const Recording& recording, const SimulatedObject& object, const Inputs& inputs, const FitOptions& options,
                           const Unknowns& unknowns, const Optimum& optimum, const OnProgress& progress);

/// The law to which the highest loads, predicted from the lower ones, come as the least surprise: `fitted`, unless another one is
/// better beyond chance. nullptr: nothing was compared, or `fitted` found no equilibrium and neither did another.
const LawFit* best_law(const std::vector<LawFit>& laws, const std::string& fitted);

}  // namespace palpate::estimation
