// SPDX-License-Identifier: Apache-2.0
// A force sensor's zero that moves while the tool pushes.
#pragma once

#include <algorithm>
#include <variant>

#include "palpate/core/recording.hpp"

namespace palpate {

/// Between the free air before a push and that after it the zero is taken to move evenly. Its error, that of two tares
/// weighted with the times to them, is then no larger than one tare's anywhere in between (Push::force_tare_std_n).
struct ForceDrift {
  Vec3 rate_n_s = Vec3::Zero();  ///< base axes
  double zero_at_s = 0;          ///< when the tare was taken that the push's forces are free of
  Vec3 at(double time_s) const { return std::max(0.0, time_s - zero_at_s) * rate_n_s; }
};

/// Takes it off every force that was measured in the push, imposed ones and observed ones.
inline void take_off(const ForceDrift& drift, Push& push) {
  for (Step& step : push.steps) {
    const Vec3 moved_n = drift.at(step.time_s);
    for (Load& load : step.loads)
      if (load.force_n) *load.force_n -= moved_n;
    for (Observation& seen : step.observations) {
      auto* wrench = std::get_if<Wrench>(&seen);
      if (wrench == nullptr) continue;
      wrench->force_n -= wrench->along.norm() > 0 ? Vec3(wrench->along.dot(moved_n) * wrench->along) : moved_n;
    }
  }
}

}  // namespace palpate
