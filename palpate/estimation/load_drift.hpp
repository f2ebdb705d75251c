// SPDX-License-Identifier: Apache-2.0
// E against load: where it drifts, the material does not obey the law.
#pragma once

#include <vector>

#include "palpate/estimation/cross_check.hpp"

namespace palpate::estimation {

/// Low and high loads ask for different E, beyond what their intervals allow.
bool drifts_with_load(const CrossChecks& checks);

/// E of the low and of the high loads, then of quarters where these differ, and how far they deform the object; empty where pushes have
/// one level only.
/// @param steps  of the answer
std::vector<YoungAtLoad> young_by_load(const CrossChecks& checks, const ForwardModel& model, const std::vector<StepFit>& steps);

/// Slope of stress over strain (travel over the object's extent along the push), from where the one before ends, the first from rest.
struct TangentModulus {
  double to_strain = 0, young_pa = 0;
};

/// One for each quarter of the loads, where the fitted law is linear: E of a quarter is a secant, which each of its steps has a say in
/// by the square of its strain. Empty where E does not drift.
std::vector<TangentModulus> tangent_moduli(const CrossChecks& checks, const ForwardModel& model, const std::vector<StepFit>& steps);

}  // namespace palpate::estimation
