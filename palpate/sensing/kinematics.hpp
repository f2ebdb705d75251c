// SPDX-License-Identifier: Apache-2.0
// Forward kinematics of a URDF tree: revolute, continuous, prismatic, fixed and mimic joints.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

/// A robot whose joints are sorted from the root and checked once; posing it is then a walk down the tree.
class Kinematics {
 public:
  /// @throws Error naming link or joint: no link, two links or joints of a name, a joint between links that do not exist, a
  ///         link with two parents, no or several roots, a loop, a mimic joint of an unknown or mimicking joint, an axis of
  ///         length zero.
  explicit Kinematics(RobotModel robot);

  const RobotModel& robot() const { return robot_; }
  Index root_link() const { return root_; }
  /// Index in robot().links. @throws Error listing the names.
  Index link(const std::string& name) const;
  /// Joints that have a value of their own (not fixed, not mimicking), in the order of the URDF.
  const std::vector<std::string>& free_joints() const { return free_joints_; }

  /// Pose of every link in the frame of the root link, in the order of robot().links.
  /// @param names, positions  radians or metres; joints that are fixed or mimic may be among them and are ignored
  /// @throws Error when a free joint has no value, a name is unknown, or the counts differ.
  std::vector<Pose> link_poses(const std::vector<std::string>& names, const std::vector<double>& positions) const;

  /// The same where joints may lack a value: nothing of the links that hang on one.
  /// @throws Error when a name is unknown, or the counts differ.
  std::vector<std::optional<Pose>> known_link_poses(const std::vector<std::string>& names,
                                                    const std::vector<double>& positions) const;
  /// T_parent_child of every joint, in the order of robot().joints: its two links' frames at these positions; nothing where a
  /// joint, or the one that it mimics, has no value.
  /// @throws Error as known_link_poses
  std::vector<std::optional<Pose>> joint_poses(const std::vector<std::string>& names, const std::vector<double>& positions) const;
  /// The free joint nearest to the root that a link hangs on and that is not among the names; nothing where all are.
  std::optional<std::string> missing_joint(Index link, const std::vector<std::string>& names) const;

  /// Covariance of the position of a point of a link in the root's frame, m2, from independent errors of all joints above it:
  /// the sum of (lever arm times sigma) (lever arm times sigma)' at this pose; a prismatic joint adds nothing to it.
  Mat3 position_covariance_m2(const std::vector<Pose>& link_poses, Index link, const Vec3& point_link_m,
                              double joint_std_rad) const;
  /// The square root of its trace: of all three axes together.
  double position_std_m(const std::vector<Pose>& link_poses, Index link, const Vec3& point_link_m,
                        double joint_std_rad) const;

 private:
  /// Of every joint, a mimic's too; NaN where it is not known.
  std::vector<double> values(const std::vector<std::string>& names, const std::vector<double>& positions) const;
  /// Of a joint's child.
  Pose below(const Pose& parent, std::size_t joint, double value) const;
  /// Whose value it takes: its own or that which it mimics.
  const RobotJoint& source(std::size_t joint) const;

  RobotModel robot_;
  Index root_ = 0;
  std::vector<Index> order_;           // joints, parents first
  std::vector<Index> parent_, child_;  // a joint: link indices
  std::vector<Index> joint_above_;     // a link: its joint, or -1
  std::vector<Index> mimicked_;        // a joint: the joint whose value it takes, or -1
  std::vector<std::string> free_joints_;
};

}  // namespace palpate::sensing
