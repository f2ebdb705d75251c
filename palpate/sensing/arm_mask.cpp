// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/arm_mask.hpp"

#include <algorithm>

#include "palpate/sensing/plane_mask.hpp"

namespace palpate::sensing {

std::vector<Stick> sticks_of(const Recording& recording, const Push& push, const Step& step) {
  if (!step.T_base_tip) return {};
  const auto pushing = std::find_if(push.steps.begin(), push.steps.end(), [](const Step& one) { return one.loads.size() == 1; });
  if (pushing == push.steps.end()) return {};
  const Load& load = pushing->loads.front();
  for (const Tool& tool : recording.tools)
    if (tool.name == load.tool && (tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc))
      return {{step.T_base_tip->translation(), load.direction, tool.radius_m}};
  return {};
}

ArmMask::ArmMask(const Recording& recording) : recording_(recording) {
  if (recording.robot && has_shapes(*recording.robot)) robot_.emplace(*recording.robot);
}

DepthFrame ArmMask::without_arm(const DepthFrame& frame, const Push& push, const Step& step) const {
  if (frame.robot_is_masked) return frame;
  if (robot_ && !step.joints_rad.empty()) return with_mask(frame, robot_->mask_known(frame, recording_.joint_names, step.joints_rad));
  return frame.mask.size() == 0 ? with_mask(frame, mask_sticks(frame, sticks_of(recording_, push, step))) : frame;
}

PointCloud ArmMask::without_arm(const PointCloud& cloud, const Push& push, const Step& step) const {
  return without_sticks(cloud, sticks_of(recording_, push, step));
}

}  // namespace palpate::sensing
