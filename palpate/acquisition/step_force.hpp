// SPDX-License-Identifier: Apache-2.0
// The force of a step out of the samples around it. Inner header of the room.
#pragma once

#include <optional>
#include <span>

#include "palpate/sensing/push_events.hpp"

namespace palpate::acquisition {

struct StepForce {
  Vec3 force_n = Vec3::Zero();
  double std_n = 0;              ///< per axis
  Vec3 rate_n_s = Vec3::Zero();  ///< zero where the force stands still
};

/// The samples' mean while the tool stands. Where it is on its way (a line through at least 8 samples changes over them by more than
/// a hundredth of the force and by ten standard errors, and its two halves rise alike), the line at `seen_s`, when the step was
/// seen (within the samples), and its slope: a mean over half a second lags behind the picture by a quarter. Nothing without samples.
std::optional<StepForce> step_force(std::span<const sensing::ContactSample> samples, double seen_s);

}  // namespace palpate::acquisition
