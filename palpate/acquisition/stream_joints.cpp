// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/stream_joints.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/acquisition/frame_tree.hpp"
#include "palpate/core/joint_motion.hpp"

namespace palpate::acquisition {
namespace {

/// An angle that is the other one, whole turns apart, and nearest to `from_rad`.
double nearest_turn(double from_rad, double to_rad) { return to_rad - 2 * M_PI * std::round((to_rad - from_rad) / (2 * M_PI)); }

bool is_continuous(const std::optional<RobotModel>& robot, const std::string& joint) {
  return robot && std::any_of(robot->joints.begin(), robot->joints.end(), [&](const RobotJoint& one) {
           return one.name == joint && one.kind == RobotJoint::Kind::continuous;
         });
}

/// What moves the joint's child to where it stands; nothing where the joint cannot.
std::optional<double> position_of(const RobotJoint& joint, const Pose& T_parent_child) {
  constexpr double near = 0.01;  // m, and of a rotation matrix: a description that was calibrated since moves less
  RobotJoint unit = joint;
  unit.axis.normalize();
  const Pose motion = joint.T_parent_joint.inverse() * T_parent_child;
  const Eigen::Quaterniond turn(motion.linear());
  const double position = joint.kind == RobotJoint::Kind::prismatic ? unit.axis.dot(motion.translation())
                                                                    : nearest_turn(0, 2 * std::atan2(unit.axis.dot(turn.vec()), turn.w()));
  if ((joint_motion(unit, position).matrix() - motion.matrix()).norm() > near) return std::nullopt;
  return position;
}

}  // namespace

std::optional<SensorStreams> with_joints_of_transforms(const std::optional<RobotModel>& robot, const SensorStreams& streams) {
  if (!robot || !streams.joints.empty()) return std::nullopt;
  const FrameTree tree(streams.frames);
  std::vector<const RobotJoint*> told;
  std::vector<double> times_s;
  for (const RobotJoint& joint : robot->joints) {
    if (joint.kind == RobotJoint::Kind::fixed || !joint.mimic.empty() || !(joint.axis.norm() > 0)) continue;
    const auto link = std::find_if(streams.frames.begin(), streams.frames.end(), [&](const FrameLink& one) {
      return one.parent == joint.parent && one.child == joint.child && !one.samples.empty() && position_of(joint, one.samples.front().T_parent_child);
    });
    if (link == streams.frames.end()) continue;
    told.push_back(&joint);
    if (times_s.empty() && !link->is_fixed)
      for (const PoseSample& sample : link->samples) times_s.push_back(sample.time_s);
  }
  if (times_s.empty()) return std::nullopt;
  SensorStreams with = streams;
  with.joint_names.clear();
  for (const RobotJoint* joint : told) with.joint_names.push_back(joint->name);
  for (const double time_s : times_s) {
    JointSample sample{time_s, {}};
    for (const RobotJoint* joint : told) {
      const auto pose = tree.lookup(joint->parent, joint->child, time_s);
      const auto position = pose ? position_of(*joint, *pose) : std::nullopt;
      if (!position) break;
      sample.positions.push_back(*position);
    }
    if (sample.positions.size() == told.size()) with.joints.push_back(std::move(sample));
  }
  return with.joints.empty() ? std::nullopt : std::optional(std::move(with));
}

bool knows(const RobotModel& robot, const std::string& joint) {
  return std::any_of(robot.joints.begin(), robot.joints.end(), [&](const RobotJoint& one) { return one.name == joint; });
}

std::optional<std::vector<double>> joints_at(const SensorStreams& streams, const std::optional<RobotModel>& robot, double time_s) {
  constexpr double near_s = 0.5;
  const auto& samples = streams.joints;
  const auto after = std::lower_bound(samples.begin(), samples.end(), time_s,
                                      [](const JointSample& sample, double time) { return sample.time_s < time; });
  if (after != samples.end() && after->time_s == time_s) return after->positions;
  if (after == samples.begin() || after == samples.end()) {
    if (samples.empty()) return std::nullopt;
    const JointSample& end = after == samples.begin() ? samples.front() : samples.back();
    return std::abs(end.time_s - time_s) < near_s ? std::optional(end.positions) : std::nullopt;
  }
  const JointSample &a = *(after - 1), &b = *after;
  if (b.time_s - a.time_s > 2 * near_s) return std::nullopt;
  const double share = (time_s - a.time_s) / (b.time_s - a.time_s);
  std::vector<double> positions;
  for (std::size_t k = 0; k < a.positions.size(); ++k) {
    // A joint that turns without end is told between -pi and pi: from one to the other is no turn back through everything.
    const bool turns = k < streams.joint_names.size() && is_continuous(robot, streams.joint_names[k]);
    const double next = turns ? nearest_turn(a.positions[k], b.positions[k]) : b.positions[k];
    positions.push_back((1 - share) * a.positions[k] + share * next);
  }
  return positions;
}

NamedJoints known_joints_at(const SensorStreams& streams, const std::optional<RobotModel>& robot, double time_s) {
  NamedJoints known;
  const auto all = joints_at(streams, robot, time_s);
  for (std::size_t k = 0; robot && all && k < streams.joint_names.size(); ++k) {
    if (!knows(*robot, streams.joint_names[k])) continue;  // of another device on the topic
    known.names.push_back(streams.joint_names[k]);
    known.positions.push_back((*all)[k]);
  }
  return known;
}

std::optional<UnmaskedLinks> unmasked_links(const sensing::RobotMask& mask, const NamedJoints& known, const SensorStreams& streams) {
  const sensing::Kinematics& kinematics = mask.kinematics();
  std::string links, missing;
  std::size_t count = 0;
  for (const Index link : mask.shaped_links()) {
    const auto joint = kinematics.missing_joint(link, known.names);
    if (!joint) continue;
    links += (count++ == 0 ? "'" : ", '") + kinematics.robot().links[std::size_t(link)].name + "'";
    if (missing.empty()) missing = *joint;
  }
  if (count == 0) return std::nullopt;
  UnmaskedLinks found;
  found.is_whole_robot = count == mask.shaped_links().size();
  found.who = found.is_whole_robot ? "the robot is" : "of the robot " + links + (count == 1 ? " is" : " are");
  const auto& told = streams.joint_names;
  found.why = std::find(told.begin(), told.end(), missing) != told.end() ? "there is no joint state near that time"
                                                                         : "its joint '" + missing + "' is not in the joint states";
  return found;
}

}  // namespace palpate::acquisition
