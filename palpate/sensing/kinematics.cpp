// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/kinematics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "palpate/core/error.hpp"
#include "palpate/core/joint_motion.hpp"

namespace palpate::sensing {
namespace {

bool moves(const RobotJoint& joint) { return joint.kind != RobotJoint::Kind::fixed; }

}  // namespace

Kinematics::Kinematics(RobotModel robot) : robot_(std::move(robot)) {
  const std::string where = "robot '" + robot_.name + "'";
  if (robot_.links.empty()) throw Error("has no link", where);
  std::map<std::string, Index> links, joints;
  for (std::size_t i = 0; i < robot_.links.size(); ++i)
    if (!links.emplace(robot_.links[i].name, Index(i)).second)
      throw Error("has two links named '" + robot_.links[i].name + "'", where);
  for (std::size_t j = 0; j < robot_.joints.size(); ++j)
    if (!joints.emplace(robot_.joints[j].name, Index(j)).second)
      throw Error("has two joints named '" + robot_.joints[j].name + "'", where);

  joint_above_.assign(robot_.links.size(), -1);
  mimicked_.assign(robot_.joints.size(), -1);
  for (std::size_t j = 0; j < robot_.joints.size(); ++j) {
    RobotJoint& joint = robot_.joints[j];
    const std::string at = where + ", joint '" + joint.name + "'";
    for (const std::string* name : {&joint.parent, &joint.child})
      if (!links.count(*name)) throw Error("connects the link '" + *name + "', which does not exist", at);
    parent_.push_back(links[joint.parent]);
    child_.push_back(links[joint.child]);
    Index& above = joint_above_[std::size_t(child_.back())];
    if (above >= 0)
      throw Error("gives the link '" + joint.child + "' a second parent (the first is joint '" +
                      robot_.joints[std::size_t(above)].name + "')",
                  at);
    above = Index(j);
    if (moves(joint)) {
      if (!(joint.axis.norm() > 1e-9)) throw Error("has an axis of length zero", at);
      joint.axis.normalize();
    }
    if (!joint.mimic.empty()) {
      if (!joints.count(joint.mimic)) throw Error("mimics the joint '" + joint.mimic + "', which does not exist", at);
      mimicked_[j] = joints[joint.mimic];
      const RobotJoint& master = robot_.joints[std::size_t(mimicked_[j])];
      if (!moves(master) || !master.mimic.empty())
        throw Error("mimics the joint '" + joint.mimic + "', which has no value of its own", at);
    } else if (moves(joint)) {
      free_joints_.push_back(joint.name);
    }
  }

  root_ = -1;
  for (std::size_t i = 0; i < robot_.links.size(); ++i)
    if (joint_above_[i] < 0) {
      if (root_ >= 0)
        throw Error("has two roots, '" + robot_.links[std::size_t(root_)].name + "' and '" + robot_.links[i].name +
                        "': every link but one needs a joint above it",
                    where);
      root_ = Index(i);
    }
  if (root_ < 0) throw Error("is a loop: no link is without a joint above it", where);
  // Breadth first from the root; what is not reached hangs on a loop.
  std::vector<Index> frontier{root_};
  for (std::size_t at = 0; at < frontier.size(); ++at)
    for (std::size_t j = 0; j < robot_.joints.size(); ++j)
      if (parent_[j] == frontier[at]) {
        order_.push_back(Index(j));
        frontier.push_back(child_[j]);
      }
  if (order_.size() != robot_.joints.size()) throw Error("has joints in a loop that the root does not reach", where);
}

Index Kinematics::link(const std::string& name) const {
  std::string names;
  for (std::size_t i = 0; i < robot_.links.size(); ++i) {
    if (robot_.links[i].name == name) return Index(i);
    names += (names.empty() ? "" : ", ") + robot_.links[i].name;
  }
  throw Error("has no link '" + name + "'; there are: " + names, "robot '" + robot_.name + "'");
}

const RobotJoint& Kinematics::source(std::size_t joint) const {
  const Index master = mimicked_[joint];
  return robot_.joints[master < 0 ? joint : std::size_t(master)];
}

std::vector<double> Kinematics::values(const std::vector<std::string>& names, const std::vector<double>& positions) const {
  const std::string where = "robot '" + robot_.name + "'";
  if (names.size() != positions.size())
    throw Error(
        "got " + std::to_string(positions.size()) + " joint positions for " + std::to_string(names.size()) + " names",
        where);
  std::vector<double> own(robot_.joints.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 0; k < names.size(); ++k) {
    bool found = false;
    for (std::size_t j = 0; j < robot_.joints.size(); ++j)
      if (robot_.joints[j].name == names[k]) {
        own[j] = positions[k];
        found = true;
      }
    if (!found) throw Error("has no joint '" + names[k] + "'", where);
  }
  std::vector<double> all = own;
  for (std::size_t j = 0; j < all.size(); ++j)
    if (mimicked_[j] >= 0)
      all[j] = robot_.joints[j].mimic_multiplier * own[std::size_t(mimicked_[j])] + robot_.joints[j].mimic_offset;
  return all;
}

Pose Kinematics::below(const Pose& parent, std::size_t joint, double value) const {
  const RobotJoint& about = robot_.joints[joint];
  return parent * about.T_parent_joint * (moves(about) ? joint_motion(about, value) : Pose(Pose::Identity()));
}

std::vector<Pose> Kinematics::link_poses(const std::vector<std::string>& names, const std::vector<double>& positions) const {
  const std::vector<double> value = values(names, positions);
  std::vector<Pose> poses(robot_.links.size(), Pose::Identity());
  for (const Index at : order_) {
    const auto j = std::size_t(at);
    if (moves(robot_.joints[j]) && !std::isfinite(value[j]))
      throw Error("has no finite position of the joint '" + source(j).name + "'", "robot '" + robot_.name + "'");
    poses[std::size_t(child_[j])] = below(poses[std::size_t(parent_[j])], j, value[j]);
  }
  return poses;
}

std::vector<std::optional<Pose>> Kinematics::known_link_poses(const std::vector<std::string>& names,
                                                              const std::vector<double>& positions) const {
  const std::vector<double> value = values(names, positions);
  std::vector<std::optional<Pose>> poses(robot_.links.size());
  poses[std::size_t(root_)] = Pose::Identity();
  for (const Index at : order_) {
    const auto j = std::size_t(at);
    const std::optional<Pose>& parent = poses[std::size_t(parent_[j])];
    if (!parent || (moves(robot_.joints[j]) && !std::isfinite(value[j]))) continue;
    poses[std::size_t(child_[j])] = below(*parent, j, value[j]);
  }
  return poses;
}

std::vector<std::optional<Pose>> Kinematics::joint_poses(const std::vector<std::string>& names,
                                                         const std::vector<double>& positions) const {
  const std::vector<double> value = values(names, positions);
  std::vector<std::optional<Pose>> poses(robot_.joints.size());
  for (std::size_t j = 0; j < poses.size(); ++j)
    if (!moves(robot_.joints[j]) || std::isfinite(value[j])) poses[j] = below(Pose::Identity(), j, value[j]);
  return poses;
}

std::optional<std::string> Kinematics::missing_joint(Index link, const std::vector<std::string>& names) const {
  std::optional<std::string> missing;
  for (Index at = link; joint_above_[std::size_t(at)] >= 0;) {
    const auto j = std::size_t(joint_above_[std::size_t(at)]);
    if (moves(robot_.joints[j]) && std::find(names.begin(), names.end(), source(j).name) == names.end())
      missing = source(j).name;
    at = parent_[j];
  }
  return missing;
}

Mat3 Kinematics::position_covariance_m2(const std::vector<Pose>& poses, Index link, const Vec3& point_link_m,
                                        double joint_std_rad) const {
  const Vec3 point = poses[std::size_t(link)] * point_link_m;
  Mat3 covariance = Mat3::Zero();
  for (Index at = link; joint_above_[std::size_t(at)] >= 0;) {
    const auto j = std::size_t(joint_above_[std::size_t(at)]);
    const RobotJoint& joint = robot_.joints[j];
    if (joint.kind == RobotJoint::Kind::revolute || joint.kind == RobotJoint::Kind::continuous) {
      const Pose& frame = poses[std::size_t(child_[j])];  // the joint's origin and axis move with its child
      const Vec3 lever = (frame.linear() * joint.axis).cross(point - frame.translation());
      covariance += joint_std_rad * joint_std_rad * lever * lever.transpose();
    }
    at = parent_[j];
  }
  return covariance;
}

double Kinematics::position_std_m(const std::vector<Pose>& poses, Index link, const Vec3& point_link_m,
                                  double joint_std_rad) const {
  return std::sqrt(position_covariance_m2(poses, link, point_link_m, joint_std_rad).trace());
}

}  // namespace palpate::sensing
