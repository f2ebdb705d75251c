// SPDX-License-Identifier: Apache-2.0
// The lab's arm: seven joints, five modules and a hand with two, a thin stick on it and perhaps a camera beside the hand.
#pragma once

#include "palpate/core/recording.hpp"

namespace palpate::lab {

struct ArmOptions {
  Pose T_base_arm = Pose::Identity();  ///< where it is screwed down, in the frame that everything is recorded in
  double stick_radius_m = 0.005;
  double stick_length_m = 0.30;
  double pad_radius_m = 0.0;  ///< 0 = the stick alone; else a disc of 8 mm on its end
  bool camera_on_hand = false;
  int round_sides = 48;       ///< of the modules' meshes: 7 links of 2 * sides * (rings - 1) triangles
  int rings = 24;
};

/// Links base (no geometry: the frame that everything is recorded in), arm_base, module_1 .. module_5, hand_pan, hand_tilt, stick
/// (fixed), tip (no geometry: origin in the tip's face, z along the push) and, where the hand carries one, camera (no geometry:
/// optical frame). Joints joint_1 .. joint_5, pan, tilt.
RobotModel arm(const ArmOptions& options = {});

}  // namespace palpate::lab
