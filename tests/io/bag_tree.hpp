// SPDX-License-Identifier: Apache-2.0
// The frames of a bag as a stranger reads them: nothing here is the product's own idea of a tree.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "palpate/io/message_source.hpp"
#include "palpate/io/ros_messages.hpp"
#include "palpate/sensing/kinematics.hpp"

namespace palpate::io::test {

struct BagTree {
  std::map<std::string, std::string> parent;  // by child
  std::map<std::string, std::map<std::int64_t, Pose>> moving;
  std::map<std::string, Pose> fixed;
  std::vector<RosJointState> joints;
  std::vector<RosHeader> images;
  std::map<std::string, std::set<std::string>> frames;  // of messages with one, by topic

  /// T_base_frame at exactly this stamp: nothing is interpolated. Nothing where some link of the way was not said then.
  std::optional<Pose> at(const std::string& base, std::string frame, std::int64_t stamp_ns) const {
    Pose pose = Pose::Identity();
    for (std::size_t step = 0; frame != base; ++step) {
      if (step > parent.size() || !parent.contains(frame)) return std::nullopt;
      if (const auto found = fixed.find(frame); found != fixed.end()) {
        pose = found->second * pose;
      } else {
        const auto& samples = moving.at(frame);
        const auto sample = samples.find(stamp_ns);
        if (sample == samples.end()) return std::nullopt;
        pose = sample->second * pose;
      }
      frame = parent.at(frame);
    }
    return pose;
  }
};

/// Holds the bag to it that a frame has one parent and stands on one of /tf and /tf_static, that no stamp is said twice on a topic,
/// and that what stands is said once, at the start.
inline BagTree tree_of(const MessageSource& bag) {
  BagTree tree;
  std::map<std::string, std::set<std::int64_t>> said;
  const auto once = [&](const std::string& topic, std::int64_t stamp_ns) {
    EXPECT_TRUE(said[topic].insert(stamp_ns).second) << topic << " says " << stamp_ns << " twice";
  };
  for (const Message& message : bag.messages) {
    const MessageTopic& topic = bag.topics[message.topic];
    if (topic.type == "tf2_msgs/msg/TFMessage") {
      const std::vector<RosTransform> transforms = decode_transforms(message.data, topic.name);
      EXPECT_FALSE(transforms.empty());
      once(topic.name, message.log_time_ns);
      for (const RosTransform& one : transforms) {
        EXPECT_EQ(one.header.stamp_ns, message.log_time_ns) << one.child;
        const auto [place, is_new] = tree.parent.emplace(one.child, one.header.frame);
        EXPECT_EQ(place->second, one.header.frame) << "a second parent of " << one.child;
        if (topic.name == "/tf_static") {
          EXPECT_TRUE(is_new) << one.child << " is said again";
          EXPECT_EQ(one.header.stamp_ns, bag.messages.front().log_time_ns);
          tree.fixed[one.child] = one.T_parent_child;
        } else {
          EXPECT_FALSE(tree.fixed.contains(one.child)) << one.child << " moves and does not";
          EXPECT_TRUE(tree.moving[one.child].emplace(one.header.stamp_ns, one.T_parent_child).second) << one.child << " twice in a stamp";
        }
      }
      continue;
    }
    if (topic.type == "std_msgs/msg/String") continue;
    const RosHeader header = decode_header(message.data, topic.name);
    EXPECT_EQ(header.stamp_ns, message.log_time_ns) << topic.name;
    once(topic.name, header.stamp_ns);
    tree.frames[topic.name].insert(header.frame);
    if (topic.type == "sensor_msgs/msg/JointState") tree.joints.push_back(decode_joint_state(message.data, topic.name));
    if (topic.type == "sensor_msgs/msg/Image") tree.images.push_back(header);
  }
  std::set<std::string> roots;
  for (const auto& [child, parent] : tree.parent)
    if (!tree.parent.contains(parent)) roots.insert(parent);
  EXPECT_EQ(roots.size(), 1u) << "frames hang together, and in no loop";
  for (const auto& [topic, frames] : tree.frames)
    for (const std::string& frame : frames) {
      const bool is_ours = topic == "/joint_states" || tree.parent.contains(frame) || roots.contains(frame);
      EXPECT_TRUE(is_ours) << topic << ": " << frame;
    }
  return tree;
}

/// Every link stands where the joints put it, whenever they are told; but for those that a recording knows better.
inline void expect_kinematics(const BagTree& tree, const RobotModel& robot, const std::set<std::string>& but = {}) {
  const sensing::Kinematics kinematics(robot);
  const std::string& root = robot.links[std::size_t(kinematics.root_link())].name;
  ASSERT_FALSE(tree.joints.empty());
  double worst = 0;
  for (const RosJointState& joints : tree.joints) {
    const std::vector<Pose> poses = kinematics.link_poses(joints.names, joints.position);
    for (std::size_t i = 0; i < robot.links.size(); ++i) {
      if (but.contains(robot.links[i].name)) continue;
      const auto said = tree.at(root, robot.links[i].name, joints.header.stamp_ns);
      ASSERT_TRUE(said) << robot.links[i].name << " at " << joints.header.stamp_ns;
      worst = std::max(worst, (said->matrix() - poses[i].matrix()).cwiseAbs().maxCoeff());
    }
  }
  EXPECT_LT(worst, 1e-9);
}

/// Where tip and camera are is known at every image, the first one too, and the tip's whenever joints are told.
inline void expect_tip_and_camera(const BagTree& tree, const std::string& base, const std::string& tip) {
  ASSERT_FALSE(tree.images.empty());
  for (const RosHeader& image : tree.images)
    for (const std::string& frame : {tip, image.frame}) {
      EXPECT_TRUE(tree.at(base, frame, image.stamp_ns)) << frame << " at " << image.stamp_ns;
    }
  for (const RosJointState& joints : tree.joints) EXPECT_TRUE(tree.at(base, tip, joints.header.stamp_ns)) << joints.header.stamp_ns;
}

}  // namespace palpate::io::test
