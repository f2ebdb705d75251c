// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/images_at_rest.hpp"

#include <algorithm>
#include <variant>

#include "palpate/sensing/arm_mask.hpp"

namespace palpate::sensing {

std::vector<DepthFrame> images_at_rest(const Recording& recording) {
  std::vector<DepthFrame> frames = recording.rest.views;
  const ArmMask arm(recording);
  for (const auto& push : recording.pushes) {
    if (push.steps.empty()) continue;
    const Step& step = push.steps.front();
    const bool loaded = std::any_of(step.loads.begin(), step.loads.end(), [](const Load& load) {
      return (load.force_n && load.force_n->norm() > 0) || load.travel_m.value_or(0) != 0 || (!load.force_n && !load.travel_m);
    });
    if (loaded || step.unloading) continue;
    for (const auto& observation : step.observations) {
      if (const auto* frame = std::get_if<DepthFrame>(&observation)) frames.push_back(arm.without_arm(*frame, push, step));
    }
  }
  return frames;
}

}  // namespace palpate::sensing
