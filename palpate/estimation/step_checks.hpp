// SPDX-License-Identifier: Apache-2.0
// What single steps say against the joint fit. Everything follows from the rows of the last evaluation, to first order; no step is
// solved.
#pragma once

#include <cstddef>
#include <optional>

#include "palpate/estimation/objective.hpp"
#include "palpate/estimation/optimise.hpp"

namespace palpate::estimation {

/// Something changed from one step of a push to the next.
struct StepChange {
  std::size_t step = 0;  ///< of the model: the first one after the change
  double size = 0;       ///< m; of settling: the share by which E fell
  double p_value = 1;    ///< chance of a change at least as large in a recording without one, over all its pushes and places where it may be
};

/// The contact of a push was elsewhere before a step than from it on: the shift that each step asks for by itself, frames free
/// under their priors, compared before and after. Asked of contacts whose place may shift (Load::contact_std_m). The most
/// significant one of all pushes. @param factor  information factor of robust rows
std::optional<StepChange> contact_slip(const Objective& objective, const Optimum& optimum, double factor);

/// Frames of a push stand elsewhere before a step than from it on, further than their pose's prior allows: object or camera was
/// moved. Asked of frames whose pose is not exactly known.
std::optional<StepChange> object_motion(const Objective& objective, const Optimum& optimum);

/// The object went on giving way while the load stayed the same (within a hundredth): E of the last such step is below that of
/// the first.
std::optional<StepChange> settling(const Objective& objective, const Optimum& optimum, double factor);

/// Do means of neighbours (image or space cells) scatter more than independent errors, and noise that is known to be shared, would? Analysis of variance, in standard
/// normal deviates (Wilson and Hilferty 1931).
struct Pattern {
  double deviate = 0;
  double inflation = 1;  ///< of the variance of a cell's mean
};
Pattern residual_pattern(const Objective& objective, const Loss& loss);

/// Highest pressure under a round tool over E, and the step where it is.
struct PatchPressure {
  double over_young = 0;
  std::size_t step = 0;
  int region = 0;  ///< that is pressed
};
PatchPressure highest_pressure(const Objective& objective, const Optimum& optimum);

}  // namespace palpate::estimation
