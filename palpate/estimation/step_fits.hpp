// SPDX-License-Identifier: Apache-2.0
// What figures need of every step, from the objective's last evaluation.
#pragma once

#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/estimation/objective.hpp"

namespace palpate::estimation {

/// Surfaces, points, residuals, forces and travels; steps that the last evaluation left out are marked as not used.
std::vector<StepFit> step_fits(const Objective& objective);

/// Standard deviations of the predicted forces and travels: what the posterior's uncertainty leaves of them, to first order.
/// @param covariance  of the unknowns `moving`
void add_bands(std::vector<StepFit>& steps, const Objective& objective, const MatrixX& covariance, const std::vector<int>& moving);

/// Von Mises stresses of the steps that are used. False: the caller stopped it.
bool add_stresses(std::vector<StepFit>& steps, ForwardModel& model, const VectorX& unknowns, const OnProgress& progress);

}  // namespace palpate::estimation
