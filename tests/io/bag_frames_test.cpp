// label: unit
// SPDX-License-Identifier: Apache-2.0
// How frames hang together in bags of robots that are not the lab's, and of none.
#include "palpate/io/bag_frames.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/bag_tree.hpp"
#include "io/made_up_recording.hpp"
#include "io/read_back.hpp"
#include "io/recording_folder.hpp"
#include "io/rosbag2_metadata.hpp"
#include "palpate/core/error.hpp"

namespace palpate::io::bag_frames_test {
namespace {

using namespace palpate::io::test;

RobotJoint joint(RobotJoint::Kind kind, const std::string& name, const std::string& parent, const std::string& child) {
  RobotJoint out;
  out.kind = kind;
  out.name = name;
  out.parent = parent;
  out.child = child;
  out.T_parent_joint = Eigen::Translation3d(0.1, -0.02, 0.3) * Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized());
  out.axis = Vec3(0, 1, 2);  // of no unit length
  return out;
}

// Names that mean something else than in a recording: `base` is no root, `camera` carries a link.
RobotModel foreign() {
  using enum RobotJoint::Kind;
  RobotModel robot;
  robot.name = "foreign";
  for (const char* link : {"finger", "world", "base", "camera", "lens", "hand"}) robot.links.push_back({link, {}, {}});
  robot.joints = {joint(fixed, "glass", "camera", "lens"),   joint(prismatic, "lift", "base", "hand"),
                  joint(fixed, "bolt", "world", "base"),     joint(continuous, "turn", "hand", "finger"),
                  joint(revolute, "nod", "hand", "camera")};
  robot.joints[4].mimic = "turn";
  robot.joints[4].mimic_multiplier = -0.5;
  robot.joints[4].mimic_offset = 0.1;
  return robot;
}

Recording with_robot(const RobotModel& robot) {
  Recording recording = made_up();
  recording.robot = robot;
  recording.joint_names = {"turn", "lift"};
  for (Push& push : recording.pushes)
    for (Step& step : push.steps) step.joints_rad = {0.1 + 0.25 * step.time_s, -0.2 + 0.01 * step.time_s};
  return recording;
}

void expect_same_poses(const Recording& recording, const Recording& back) {
  ASSERT_EQ(back.pushes.size(), recording.pushes.size());
  for (std::size_t p = 0; p < back.pushes.size(); ++p) {
    ASSERT_EQ(back.pushes[p].steps.size(), recording.pushes[p].steps.size());
    for (std::size_t i = 0; i < back.pushes[p].steps.size(); ++i) {
      const Step &was = recording.pushes[p].steps[i], &is = back.pushes[p].steps[i];
      EXPECT_EQ(is.joints_rad, was.joints_rad);
      // Where the travel is an observation it says how far the tip is along the push.
      Vec3 tip_m = was.T_base_tip->translation();
      if (!was.loads.empty()) tip_m.z() -= 0.0002;
      EXPECT_LT((is.T_base_tip->translation() - tip_m).norm(), 1e-12) << p << " " << i;
      EXPECT_LT((is.T_base_tip->linear() - was.T_base_tip->linear()).norm(), 1e-12);
      const auto image = [](const Step& step) { return std::get<DepthFrame>(step.observations[step.loads.empty() ? 0 : 1]); };
      EXPECT_LT((image(is).T_base_camera.matrix() - image(was).T_base_camera.matrix()).norm(), 1e-12) << p << " " << i;
    }
  }
}

struct Bag {
  explicit Bag(const Recording& recording) : folder("bag_frames") {
    write_bag(recording, folder.path() / "bag");
    source = read_bag(folder.path() / "bag");
    tree = tree_of(source);
  }
  TemporaryFolder folder;
  MessageSource source;
  BagTree tree;
};

TEST(BagFrames, OfOneNameMeanOneThing) {
  const Recording recording = with_robot(foreign());
  const Bag bag(recording);
  EXPECT_EQ(bag.tree.parent.at("tip"), "lens") << "its last link";
  EXPECT_EQ(bag.tree.parent.at("depth_camera"), "world") << "the robot's `camera` is another one";
  EXPECT_EQ(bag.tree.frames.at("/wrench"), std::set<std::string>{"world"});
  expect_kinematics(bag.tree, foreign());
  expect_tip_and_camera(bag.tree, "world", "tip");
  expect_same_poses(recording, read_back(bag.folder.path() / "bag"));
}

TEST(BagFrames, OfALeafAreWhereTheRecordingSaysAndNotWhereTheRobotDoes) {
  RobotModel robot = foreign();
  robot.links.push_back({"tip", {}, {}});
  robot.joints.push_back(joint(RobotJoint::Kind::fixed, "stick", "finger", "tip"));
  robot.links[3].name = "arm";
  robot.links[4].name = "camera";
  robot.joints[0].parent = robot.joints[4].child = "arm";
  robot.joints[0].child = "camera";
  const Recording recording = with_robot(robot);
  const Bag bag(recording);
  EXPECT_EQ(bag.tree.parent.at("tip"), "finger");
  EXPECT_EQ(bag.tree.parent.at("camera"), "arm");
  EXPECT_TRUE(bag.tree.fixed.empty());
  expect_kinematics(bag.tree, robot, {"tip", "camera"});
  expect_tip_and_camera(bag.tree, "world", "tip");
  expect_same_poses(recording, read_back(bag.folder.path() / "bag"));
}

TEST(BagFrames, WithoutARobotHangOnTheBase) {
  const Recording recording = made_up();
  const Bag bag(recording);
  EXPECT_EQ(bag.tree.parent, (std::map<std::string, std::string>{{"tip", "base"}, {"camera", "base"}}));
  EXPECT_EQ(bag.tree.moving.size(), 2u) << "its camera moves";
  expect_tip_and_camera(bag.tree, "base", "tip");
  expect_same_poses(recording, read_back(bag.folder.path() / "bag"));
}

TEST(BagFrames, OfARobotWhoseJointsAreNotAllToldHangOnItsRoot) {
  Recording recording = with_robot(foreign());
  recording.pushes[1].steps[2].joints_rad.clear();
  const Bag bag(recording);
  EXPECT_EQ(bag.tree.parent, (std::map<std::string, std::string>{{"tip", "world"}, {"depth_camera", "world"}}));
}

TEST(BagFrames, OfACameraThatStandsAreSaidOnceAndKept) {
  Recording recording = made_up();
  for (Push& push : recording.pushes)
    for (Step& step : push.steps)
      for (Observation& one : step.observations)
        if (auto* image = std::get_if<DepthFrame>(&one))
          image->T_base_camera = Eigen::Translation3d(0, 0, 0.5) * Eigen::AngleAxisd(3.1, Vec3::UnitX());
  const Bag bag(recording);
  EXPECT_TRUE(bag.tree.fixed.contains("camera"));
  EXPECT_EQ(bag.tree.moving.size(), 1u);
  expect_tip_and_camera(bag.tree, "base", "tip");
  expect_same_poses(recording, read_back(bag.folder.path() / "bag"));
  const Rosbag2Metadata about = rosbag2_metadata(bag.folder.path() / "bag");
  for (const auto& [topic, offer] : about.offers) {
    YamlKeys one(YamlField::parse(offer, topic).items().at(0));
    EXPECT_EQ(one.required("reliability").text(), "1") << topic;
    EXPECT_EQ(one.required("durability").text(), topic == "/tf_static" ? "1" : "2") << topic << ": 1 is transient local";
    // The same words beside the channel in the file, in its summary, which is not packed.
    const std::string file = bag.folder.get("bag/bag_0.mcap");
    EXPECT_NE(file.substr(file.rfind(topic + std::string("\3\0\0\0cdr", 7))).substr(0, 600).find(offer), std::string::npos) << topic;
  }
  EXPECT_EQ(about.offers.size(), bag.source.topics.size());
}

/// Whether it moves is not known at its first images: what was said at their stamps waits.
TEST(BagFrames, OfACameraThatMovesInARunStandInOneMessageAStamp) {
  const TemporaryFolder folder("bag_frames");
  const Pose there = Pose(Eigen::Translation3d(0, 0, 1)), elsewhere = Pose(Eigen::Translation3d(0, 0, 2));
  BagFrames frames({}, {});
  BagFolder bag;
  for (int k = 0; k < 40; ++k) {
    frames.robot_at(1000 + k, {}, there, bag);
    if (k % 10 == 5) frames.camera_at(1000 + k, "camera", k < 20 ? there : elsewhere, bag);
  }
  frames.put_rest(bag);
  bag.write(folder.path());
  const BagTree tree = tree_of(read_bag(folder.path()));
  EXPECT_EQ(tree.moving.at("tip").size(), 40u);
  ASSERT_EQ(tree.moving.at("camera").size(), 4u);
  for (const auto& [stamp_ns, pose] : tree.moving.at("camera")) EXPECT_EQ(pose.translation().z(), stamp_ns < 1020 ? 1 : 2) << stamp_ns;
}

/// A run that goes on with a bag: the camera may have moved in between, and its poses so far stay what they were.
TEST(BagFrames, OfACameraThatMovesLaterAreSaidOfEveryImage) {
  const TemporaryFolder folder("bag_frames");
  const Pose there = Pose(Eigen::Translation3d(0, 0, 1)), elsewhere = Pose(Eigen::Translation3d(0, 0, 2));
  const auto see = [](std::int64_t stamp_ns, BagFolder& bag) {
    bag.put("/camera_info", "sensor_msgs/msg/CameraInfo", stamp_ns, encode(RosCameraInfo{{stamp_ns, "camera"}, {8, 6, 10, 11, 3, 2, {}, {}}}));
  };
  const auto written = [&](const BagFolder& bag, const BagFrames& frames) {
    BagFolder whole = bag;
    frames.put_rest(whole);
    whole.write(folder.path());
    return read_bag(folder.path());
  };
  BagFrames first({}, {});
  BagFolder bag;
  for (const std::int64_t stamp_ns : {1000, 2000}) {
    first.robot_at(stamp_ns, {}, there, bag);
    first.camera_at(stamp_ns, "camera", there, bag);
    see(stamp_ns, bag);
  }
  const MessageSource stood = written(bag, first);
  EXPECT_TRUE(tree_of(stood).fixed.contains("camera"));

  BagFrames later({}, {});
  later.go_on(frames_said(stood));
  BagFolder more;
  more.put_all(stood, "/tf_static");
  EXPECT_EQ(tree_of(written(more, later)).fixed.size(), 1u) << "it has not moved";
  later.robot_at(3000, {}, there, more);
  later.camera_at(3000, "camera", elsewhere, more);
  see(3000, more);
  const MessageSource moved = written(more, later);
  std::map<std::int64_t, double> height;
  for (const Message& message : moved.messages)
    if (moved.topics[message.topic].type == "tf2_msgs/msg/TFMessage")
      for (const RosTransform& one : decode_transforms(message.data, ""))
        if (one.child == "camera") height[one.header.stamp_ns] = one.T_parent_child.translation().z();
  EXPECT_EQ(height, (std::map<std::int64_t, double>{{1000, 1}, {2000, 1}, {3000, 2}}));
  for (const MessageTopic& topic : moved.topics) EXPECT_NE(topic.name, "/tf_static");

  BagFrames last({}, {});
  last.go_on(frames_said(moved));
  last.camera_at(4000, "camera", elsewhere, more);
  for (const MessageTopic& topic : written(more, last).topics) EXPECT_NE(topic.name, "/tf_static") << "it did move once";

  const Recording recording = with_robot(foreign());
  BagFrames others(recording.robot, recording.joint_names);
  EXPECT_THROW(others.go_on(frames_said(moved)), Error) << "there the tip hangs on the base, here on a finger";
}

}  // namespace
}  // namespace palpate::io::bag_frames_test
