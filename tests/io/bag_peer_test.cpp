// label: contract
// SPDX-License-Identifier: Apache-2.0
// Bags that ROS 1 itself wrote (tests/io/peer/write_ros1.py): two kept as files, and fresh ones where python3-rosbag is
// there.
#include <gtest/gtest.h>

#include <cstdlib>

#include "io/recording_folder.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::io::bag_peer_test {
namespace {

using namespace palpate::io::test;

/// The message on a topic by its place in time.
std::string_view message_of(const MessageSource& bag, const std::string& topic, std::size_t number) {
  for (const Message& message : bag.messages) {
    if (bag.topics[message.topic].name == topic && number-- == 0) return message.data;
  }
  ADD_FAILURE() << "no message on " << topic;
  return {};
}

void expect_what_the_script_wrote(const MessageSource& bag) {
  EXPECT_TRUE(bag.warnings.empty()) << bag.warnings.front();
  ASSERT_EQ(bag.topics.size(), 9u);
  ASSERT_EQ(bag.messages.size(), 27u);
  for (const MessageTopic& topic : bag.topics) {
    EXPECT_EQ(topic.messages, 3u) << topic.name;
    EXPECT_EQ(topic.encoding, MessageEncoding::ros1);
    EXPECT_NO_THROW(ros_type(topic.type)) << topic.type;
  }
  constexpr auto ros1 = MessageEncoding::ros1;
  for (std::size_t i = 0; i < 3; ++i) {
    const double k = static_cast<double>(i);
    const RosWrench wrench = decode_wrench(message_of(bag, "/wrench", i), "m", ros1);
    EXPECT_EQ(wrench.force_n, Vec3(k, 0.5, -2));
    EXPECT_EQ(wrench.torque_nm, Vec3(0, 0, 0.25));
    EXPECT_EQ(wrench.header.stamp_ns, static_cast<std::int64_t>(100 + i) * 1000000000 + 5);
    EXPECT_EQ(wrench.header.frame, "sensor");
    const RosJointState joints = decode_joint_state(message_of(bag, "/joint_states", i), "m", ros1);
    EXPECT_EQ(joints.names, (std::vector<std::string>{"a", "elbow"}));
    EXPECT_EQ(joints.position, (std::vector<double>{0.1, 0.2 + k}));
    const auto transforms = decode_transforms(message_of(bag, "/tf", i), "m", ros1);
    ASSERT_EQ(transforms.size(), 1u);
    EXPECT_EQ(transforms[0].child, "tip");
    EXPECT_NEAR(transforms[0].T_parent_child.linear()(0, 0), 0.36 - 0.64, 1e-12);
    EXPECT_NEAR(transforms[0].T_parent_child.translation().x(), 0.1 * k, 1e-15);
    const DepthImage depth = decode_image(message_of(bag, "/depth", i), "m", ros1).depth_m;
    ASSERT_EQ(depth.rows(), 2);
    EXPECT_FLOAT_EQ(depth(1, 2), 1.005f + 0.01f * static_cast<float>(i));
    EXPECT_EQ(decode_compressed_depth(message_of(bag, "/depth/compressedDepth", i), "m", ros1).depth_m, depth);
    EXPECT_EQ(decode_image(message_of(bag, "/depth_real", i), "m", ros1).depth_m(0, 1), 2.25f + static_cast<float>(i));
    const Camera camera = decode_camera_info(message_of(bag, "/info", i), "m", ros1).camera;
    EXPECT_EQ(camera.fy_px, 501);
    EXPECT_EQ(camera.distortion, DistortionModel::plumb_bob);
    const Points points = decode_point_cloud(message_of(bag, "/points", i), "m", ros1).cloud.points_m;
    ASSERT_EQ(points.rows(), 1) << "the other point is NaN";
    EXPECT_EQ(points(0, 2), 0.3 + k);
    EXPECT_EQ(decode_string(message_of(bag, "/robot_description", i), "m", ros1), "<robot/>");
  }
}

TEST(BagPeers, FilesThatRosWroteAreRead) {
  for (const char* compression : {"bz2", "lz4"}) {
    SCOPED_TRACE(compression);
    expect_what_the_script_wrote(
        read_bag(std::string(PALPATE_SOURCE_DIR) + "/tests/io/files/peer_ros1_" + compression + ".bag"));
  }
}

TEST(BagPeers, WhatRosWritesNowIsRead) {
  if (std::system("/usr/bin/python3 -c 'import rosbag, sensor_msgs, tf2_msgs' 2> /dev/null") != 0)
    GTEST_SKIP() << "python3-rosbag, python3-sensor-msgs and python3-tf2-msgs are not installed";
  const TemporaryFolder folder("ros1_peer");
  for (const std::string compression : {"none", "bz2", "lz4"}) {
    SCOPED_TRACE(compression);
    const std::string file = (folder.path() / (compression + ".bag")).string();
    ASSERT_EQ(
        std::system(
            ("/usr/bin/python3 '" PALPATE_SOURCE_DIR "/tests/io/peer/write_ros1.py' '" + file + "' " + compression).c_str()),
        0);
    expect_what_the_script_wrote(read_bag(file));
  }
}

}  // namespace
}  // namespace palpate::io::bag_peer_test
