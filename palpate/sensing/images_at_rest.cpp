// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/images_at_rest.hpp"

#include <algorithm>
#include <optional>
#include <variant>

#include "palpate/sensing/plane_mask.hpp"
#include "palpate/sensing/robot_mask.hpp"

namespace palpate::sensing {

bool has_shapes(const RobotModel& robot) {
  return std::any_of(robot.links.begin(), robot.links.end(),
                     [](const RobotLink& link) { return !link.visual.empty() || !link.collision.empty(); });
}

std::vector<DepthFrame> images_at_rest(const Recording& recording) {
  std::vector<DepthFrame> frames = recording.rest.views;
  std::optional<RobotMask> robot;
  if (recording.robot && has_shapes(*recording.robot)) robot.emplace(*recording.robot);
  for (const auto& push : recording.pushes) {
    if (push.steps.empty()) continue;
    const Step& step = push.steps.front();
    const bool loaded = std::any_of(step.loads.begin(), step.loads.end(), [](const Load& load) {
      return (load.force_n && load.force_n->norm() > 0) || load.travel_m.value_or(0) != 0 || (!load.force_n && !load.travel_m);
    });
    if (loaded || step.unloading) continue;
    for (const auto& observation : step.observations) {
      const auto* frame = std::get_if<DepthFrame>(&observation);
      if (frame == nullptr) continue;
      frames.push_back(robot && !frame->robot_is_masked && !step.joints_rad.empty()
                           ? with_mask(*frame, robot->mask_known(*frame, recording.joint_names, step.joints_rad))
                           : *frame);
    }
  }
  return frames;
}

}  // namespace palpate::sensing
