// SPDX-License-Identifier: Apache-2.0
// E against load: where it drifts, the material does not obey the law.
#pragma once

#include <vector>

#include "palpate/estimation/cross_check.hpp"

namespace palpate::estimation {

/// Low and high loads ask for different E, beyond what their intervals allow.
bool drifts_with_load(const CrossChecks& checks);

/// E of the low and of the high loads, and how far these deform the object; empty where pushes have one level only.
/// @param steps  of the answer
std::vector<YoungAtLoad> young_by_load(const CrossChecks& checks, const ForwardModel& model, const std::vector<StepFit>& steps);

}  // namespace palpate::estimation
