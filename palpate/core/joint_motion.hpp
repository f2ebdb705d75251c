// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/recording.hpp"

namespace palpate {

/// What a joint adds to T_parent_joint at a position, in radians or metres; its axis is of unit length.
inline Pose joint_motion(const RobotJoint& joint, double position) {
  Pose motion = Pose::Identity();
  if (joint.kind == RobotJoint::Kind::prismatic)
    motion.translation() = position * joint.axis;
  else if (joint.kind != RobotJoint::Kind::fixed)
    motion.linear() = Eigen::AngleAxisd(position, joint.axis).toRotationMatrix();
  return motion;
}

}  // namespace palpate
