// label: contract
// SPDX-License-Identifier: Apache-2.0
// What other people's readers find in the bags that are written, and in the databases that tests of the reader stand on.
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "io/bag_files.hpp"
#include "io/made_up_recording.hpp"
#include "palpate/io/bag_write.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::io::rosbag2_peer_test {
namespace {

using namespace palpate::io::test;
using nlohmann::json;

const std::string peer = std::string(PALPATE_SOURCE_DIR) + "/tests/io/peer";

std::string why_not(const std::string& package) {
  if (std::system("node --version > /dev/null 2>&1") != 0) return "no node";
  return std::filesystem::exists(peer + "/node_modules/" + package) ? "" : "run `npm install` in tests/io/peer";
}

json told_by(const std::string& script, const std::filesystem::path& bag, const TemporaryFolder& folder) {
  const std::string out = (folder.path() / "out.json").string();
  const std::string command = "node '" + peer + "/" + script + "' '" + bag.string() + "' > '" + out + "'";
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  return json::parse(folder.get("out.json"));
}

Recording with_joints() {
  Recording recording = made_up();
  recording.joint_names = {"lift", "elbow"};
  for (Push& push : recording.pushes)
    for (Step& step : push.steps) step.joints_rad = {0.1 + 0.25 * step.time_s, -0.2};
  return recording;
}

std::vector<TestMessage> messages_of(const MessageSource& bag) {
  std::vector<TestMessage> all;
  for (const Message& one : bag.messages)
    all.push_back({bag.topics[one.topic].name, bag.topics[one.topic].type, one.log_time_ns, std::string(one.data)});
  return all;
}

/// A number of JSON's comes back exactly.
void expect_xyz(const json& told, const Vec3& ours) {
  EXPECT_EQ(Vec3(told["x"], told["y"], told["z"]), ours);
}

void expect_same(const json& told, const TestMessage& ours, const Recording& recording, std::size_t number) {
  const json& data = told["data"];
  const std::string& type = ours.type;
  EXPECT_EQ(told["type"], type);
  EXPECT_EQ(told["time"].get<std::int64_t>(), ours.time_ns);
  if (type == "geometry_msgs/msg/WrenchStamped") {
    const RosWrench wrench = decode_wrench(ours.data, "m");
    expect_xyz(data["wrench"]["force"], wrench.force_n);
    expect_xyz(data["wrench"]["torque"], wrench.torque_nm);
    EXPECT_EQ(data["header"]["frame_id"], wrench.header.frame);
    EXPECT_EQ(data["header"]["stamp"]["sec"].get<std::int64_t>(), wrench.header.stamp_ns / 1'000'000'000);
    const Load& load = recording.pushes[number / 6].steps[1 + number % 6 / 2].loads[0];
    EXPECT_NEAR(wrench.force_n.z(), load.force_n->z() + (number % 2 == 0 ? 1 : -1) * load.force_std_n, 1e-12);
  } else if (type == "sensor_msgs/msg/JointState") {
    const RosJointState joints = decode_joint_state(ours.data, "m");
    EXPECT_EQ(data["name"].get<std::vector<std::string>>(), recording.joint_names);
    EXPECT_EQ(data["position"].get<std::vector<double>>(), joints.position);
    EXPECT_EQ(joints.position, recording.pushes[number / 4].steps[number % 4].joints_rad);
  } else if (type == "tf2_msgs/msg/TFMessage") {
    const std::vector<RosTransform> transforms = decode_transforms(ours.data, "m");
    ASSERT_EQ(data["transforms"].size(), transforms.size());
    for (std::size_t i = 0; i < transforms.size(); ++i) {
      const json& one = data["transforms"][i];
      EXPECT_EQ(one["child_frame_id"], transforms[i].child);
      expect_xyz(one["transform"]["translation"], transforms[i].T_parent_child.translation());
      const json& q = one["transform"]["rotation"];
      const Eigen::Quaterniond turn(q["w"], q["x"], q["y"], q["z"]);
      EXPECT_LT((turn.toRotationMatrix() - transforms[i].T_parent_child.linear()).norm(), 1e-14);
    }
  } else if (type == "sensor_msgs/msg/CameraInfo") {
    EXPECT_EQ(data["k"].get<std::vector<double>>(), (std::vector<double>{10, 0, 3.5, 0, 11, 2.5, 0, 0, 1}));
    EXPECT_EQ(data["distortion_model"], "plumb_bob");
    EXPECT_EQ(data["width"], 8);
  } else if (type == "sensor_msgs/msg/Image" && ours.topic == "/camera/depth/image") {
    EXPECT_EQ(data["encoding"], "32FC1");
    EXPECT_EQ(data["step"], 8 * 4);
    std::string pixels;
    for (const Observation& one : recording.pushes[number / 4].steps[number % 4].observations) {
      const auto* frame = std::get_if<DepthFrame>(&one);
      if (frame == nullptr) continue;
      for (Eigen::Index i = 0; i < frame->depth_m.rows(); ++i)
        for (Eigen::Index k = 0; k < frame->depth_m.cols(); ++k) store(pixels, frame->depth_m(i, k));
    }
    EXPECT_EQ(data["sha256"], sha256_hex(pixels));
  } else if (type == "sensor_msgs/msg/Image") {
    const MaskImage mask = decode_mask(ours.data, "m");
    EXPECT_EQ(data["encoding"], "mono8");
    std::string pixels;
    for (Eigen::Index i = 0; i < mask.rows(); ++i)
      for (Eigen::Index k = 0; k < mask.cols(); ++k) pixels += mask(i, k) != 0 ? '\xff' : '\0';
    EXPECT_EQ(data["sha256"], sha256_hex(pixels));
  } else if (type == "sensor_msgs/msg/PointCloud2") {
    EXPECT_EQ(data["width"].get<std::size_t>() * data["height"].get<std::size_t>(), 3u);
    EXPECT_EQ(data["sha256"], sha256_hex(std::string_view(ours.data).substr(ours.data.size() - 1 - 3 * 12, 3 * 12)));
  } else {
    ASSERT_EQ(type, "std_msgs/msg/String");
    EXPECT_EQ(data["data"], decode_string(ours.data, "m"));
  }
}

void expect_all_same(const json& told, const std::vector<TestMessage>& ours, const Recording& recording) {
  std::map<std::string, std::vector<json>> found;
  for (const json& one : told["messages"]) found[one["topic"]].push_back(one);
  std::map<std::string, std::size_t> number;
  for (const TestMessage& one : ours) {
    SCOPED_TRACE(one.topic);
    const std::size_t i = number[one.topic]++;
    ASSERT_LT(i, found[one.topic].size());
    expect_same(found[one.topic][i], one, recording, i);
  }
  EXPECT_EQ(told["messages"].size(), ours.size());
  EXPECT_EQ(number["/wrench"], 12u);
  EXPECT_EQ(number["/joint_states"], 8u);
  EXPECT_EQ(number["/camera/depth/image"], 8u);
  EXPECT_EQ(number["/camera/depth/camera_info"], 8u);
  EXPECT_EQ(number["/points"], 8u);
}

/// @mcap/core reads it by its index (and checks every check sum), @foxglove/rosmsg2-serialization decodes by the schemas in
/// it.
TEST(Rosbag2Peers, ReadTheMcapThatIsWritten) {
  if (const std::string why = why_not("@mcap/core"); !why.empty()) GTEST_SKIP() << why;
  const TemporaryFolder folder("bag_peer");
  const Recording recording = with_joints();
  write_bag(recording, folder.path() / "bag");
  const json told = told_by("read_mcap.mjs", folder.path() / "bag/bag_0.mcap", folder);
  const std::vector<TestMessage> ours = messages_of(read_bag(folder.path() / "bag"));
  EXPECT_EQ(told["statistics"]["messageCount"].get<std::size_t>(), ours.size());
  EXPECT_EQ(told["profile"], "ros2");
  expect_all_same(told, ours, recording);
}

/// @foxglove/rosbag2 with the definitions of ROS 2's types that it brings: those databases that the tests write are such as
/// others read, and the messages are ROS's and not only ours.
TEST(Rosbag2Peers, ReadTheDatabasesOfTheTests) {
  if (const std::string why = why_not("@foxglove/rosbag2-web"); !why.empty()) GTEST_SKIP() << why;
  const TemporaryFolder folder("bag_peer");
  const Recording recording = with_joints();
  write_bag(recording, folder.path() / "bag");
  const std::vector<TestMessage> written = messages_of(read_bag(folder.path() / "bag"));
  for (const int schema : {1, 2, 3, 4}) {
    SCOPED_TRACE(schema);
    folder.put("bag.db3", sqlite_bytes(written, schema));
    const std::vector<TestMessage> ours = messages_of(read_bag(folder.path() / "bag.db3"));
    expect_all_same(told_by("read_sqlite.mjs", folder.path() / "bag.db3", folder), ours, recording);
  }
}

}  // namespace
}  // namespace palpate::io::rosbag2_peer_test
