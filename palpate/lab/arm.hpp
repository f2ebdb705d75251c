// SPDX-License-Identifier: Apache-2.0
// The lab's arm: seven joints, five modules and a hand with two, a thin stick on it and a camera beside the hand.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/sensing/kinematics.hpp"

namespace palpate::lab {

struct ArmOptions {
  double stick_radius_m = 0.005;
  double stick_length_m = 0.30;
  double pad_radius_m = 0.0;  ///< 0 = the stick alone; else a disc of 8 mm on its end
  int round_sides = 48;       ///< of the modules' meshes: 7 links of 2 * sides * (rings - 1) triangles
  int rings = 24;
};

/// Links base, module_1 .. module_5, hand_pan, hand_tilt, stick (fixed), tip (no geometry: origin in the tip's face, z along
/// the push) and camera (no geometry: optical frame). Joints joint_1 .. joint_5, pan, tilt.
RobotModel arm(const ArmOptions& options = {});

struct ReachOptions {
  double position_tolerance_m = 1e-6;
  double angle_tolerance_rad = 1e-6;
  bool any_roll = true;  ///< the rotation about the tip's z axis is free: sticks are round
  int max_iterations = 400;
};

/// Joint positions that bring a link to a pose: damped least squares from `start` and, when that is caught, from seeded
/// others. Nothing when no start reaches it within the joints' limits.
std::optional<std::vector<double>> reach(const sensing::Kinematics& kinematics, Index link, const Pose& T_root_link,
                                         const std::vector<double>& start, const ReachOptions& options = {});

}  // namespace palpate::lab
