// SPDX-License-Identifier: Apache-2.0
// What streams tell of a robot's joints, and of its links what they leave open. Inner header of the room.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/core/streams.hpp"
#include "palpate/sensing/robot_mask.hpp"

namespace palpate::acquisition {

/// True when a robot's description has a joint of that name.
bool knows(const RobotModel& robot, const std::string& joint);

/// The streams with joint states made of their transforms, as `robot_state_publisher` made those of the joints: where there are no joint
/// states and transforms tell where links stand on each other, as these joints can move them. Nothing elsewhere.
std::optional<SensorStreams> with_joints_of_transforms(const std::optional<RobotModel>& robot, const SensorStreams& streams);

/// Joints at a time, interpolated, continuous ones of the robot the short way around; nothing away from any sample.
std::optional<std::vector<double>> joints_at(const SensorStreams& streams, const std::optional<RobotModel>& robot, double time_s);

/// Those of them that the robot's description knows; none without one, and away from any sample.
struct NamedJoints {
  std::vector<std::string> names;
  std::vector<double> positions;
};
NamedJoints known_joints_at(const SensorStreams& streams, const std::optional<RobotModel>& robot, double time_s);

/// Links with a shape that cannot be masked since they hang on a joint without a value, in words.
struct UnmaskedLinks {
  bool is_whole_robot = false;
  std::string who;  ///< "the robot is", "of the robot 'finger' is"
  std::string why;  ///< of the first: "its joint 'open' is not in the joint states"
};
/// Nothing where all can be.
std::optional<UnmaskedLinks> unmasked_links(const sensing::RobotMask& mask, const NamedJoints& known, const SensorStreams& streams);

}  // namespace palpate::acquisition
