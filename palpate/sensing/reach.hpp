// SPDX-License-Identifier: Apache-2.0
// Inverse kinematics of a URDF tree by damped least squares (Wampler 1986), from several starts.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "palpate/sensing/kinematics.hpp"

namespace palpate::sensing {

struct ReachOptions {
  double position_tolerance_m = 1e-6;
  double angle_tolerance_rad = 1e-6;
  bool any_roll = true;  ///< the rotation about the tip's z axis is free: sticks are round
  Pose T_link_tip = Pose::Identity();  ///< what is to be brought there, in the frame of its link
  int max_iterations = 400;
  int starts = 20;
  /// Says whether joint positions that reach the pose will do (no collision, ...); empty: all do.
  std::function<bool(const std::vector<double>& joints)> accept;
};

/// Joint positions that bring a link's tip to a pose: damped least squares from `start` and, when that is caught or not
/// accepted, from seeded others. Nothing when no start reaches it within the joints' limits.
/// @param start  one value a free joint (radians or metres), in their order
/// @throws Error when the counts differ.
std::optional<std::vector<double>> reach(const Kinematics& kinematics, Index link, const Pose& T_root_tip,
                                         const std::vector<double>& start, const ReachOptions& options = {});

}  // namespace palpate::sensing
