// label: unit
// SPDX-License-Identifier: Apache-2.0
// What a robot's description adds to streams: where the tip is, and which pixels show it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "acquisition/pressed_spring.hpp"
#include "palpate/acquisition/stream_joints.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition::stream_robot_test {
namespace {

using namespace palpate::acquisition::test;
using testing::HasSubstr;

/// A column that goes up and down, with a box for a tool; its tip's frame turns z down.
RobotModel column() {
  RobotModel robot;
  robot.name = "column";
  RobotLink tip{"tip", {}, {}};
  RobotShape box;
  box.kind = RobotShape::Kind::box;
  box.size_m = Vec3(0.02, 0.02, 0.02);
  tip.visual.push_back(box);
  robot.links = {{"base", {}, {}}, {"carriage", {}, {}}, tip};
  RobotJoint lift;
  lift.kind = RobotJoint::Kind::prismatic;
  lift.name = "lift";
  lift.parent = "base";
  lift.child = "carriage";
  lift.axis = Vec3::UnitZ();
  lift.T_parent_joint.translation() = Vec3(0.3, 0.1, 0);
  lift.lower = -1, lift.upper = 1;
  RobotJoint flange;
  flange.name = "flange";
  flange.parent = "carriage";
  flange.child = "tip";
  flange.T_parent_joint.linear() = tip_at(0).linear();
  robot.joints = {lift, flange};
  return robot;
}

std::string refusal(const StreamPlan& plan, const SensorStreams& streams) {
  try {
    recording_from(plan, streams);
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing";
}

TEST(FromStreams, WithoutTransformsOfTheTipTheJointsTellWhereItIs) {
  SensorStreams streams = lab();
  FrameLink& tip = streams.frames[0];
  streams.joint_names = {"gripper_of_another_device", "lift"};
  for (const PoseSample& sample : tip.samples) streams.joints.push_back({sample.time_s, {0.5, height_m(sample.time_s)}});
  streams.frames.erase(streams.frames.begin());
  StreamPlan by_joints = stream_plan();
  by_joints.recording.robot = column();
  const auto with_joints = recording_from(by_joints, streams).recording.pushes,
             with_frames = recording_from(stream_plan(), lab()).recording.pushes;
  ASSERT_EQ(with_joints.size(), 1u);
  ASSERT_EQ(with_joints[0].steps.size(), with_frames[0].steps.size());
  for (std::size_t i = 1; i + 1 < with_joints[0].steps.size(); ++i) {
    EXPECT_LT((*with_joints[0].steps[i].loads[0].force_n - *with_frames[0].steps[i].loads[0].force_n).norm(), 1e-9);
    EXPECT_NEAR(travel_of(with_joints[0].steps[i]), travel_of(with_frames[0].steps[i]), 1e-9);
  }
}

TEST(FromStreams, PixelsOfTheRobotAreLeftOut) {
  SensorStreams streams = lab();
  for (const PoseSample& sample : streams.frames[0].samples)
    streams.joints.push_back({sample.time_s, {height_m(sample.time_s)}});
  streams.joint_names = {"lift"};
  // A camera 40 cm above the tool that looks down.
  Pose above = Pose::Identity();
  above.linear() = tip_at(0).linear();
  above.translation() = Vec3(0.3, 0.1, 0.5);
  streams.frames[2].samples[0].T_parent_child = above;
  streams.cameras[0].mask_robot = true;
  streams.cameras[0].like.camera = {64, 48, 200, 200, 31.5, 23.5, DistortionModel::none, {}};
  streams.cameras[0].image = [](std::size_t) { return DepthImage(DepthImage::Constant(48, 64, 0.5f)); };
  StreamPlan masked = stream_plan();
  masked.recording.robot = column();
  const FromStreams made = recording_from(masked, streams);
  for (const Step& step : made.recording.pushes[0].steps) {
    for (const Observation& one : step.observations) {
      const auto* frame = std::get_if<DepthFrame>(&one);
      if (frame == nullptr) continue;
      ASSERT_EQ(frame->mask.rows(), 48);
      EXPECT_EQ(frame->mask(24, 32), 1) << "the tool, in the middle of the picture";
      EXPECT_EQ(frame->mask(2, 2), 0);
      // 2 cm at about 40 cm: 10 pixels a side, widened by the mask's margins.
      EXPECT_GT(frame->mask.cast<int>().sum(), 80);
      EXPECT_LT(frame->mask.cast<int>().sum(), 600);
    }
  }
  masked.recording.robot.reset();
  EXPECT_THROW(recording_from(masked, streams), Error) << "no description, no mask";
}

TEST(FromStreams, ImagesWithoutARobotAreNotCalledMasked) {
  SensorStreams streams = lab();
  const auto called_masked = [&] {
    for (const Step& step : recording_from(stream_plan(), streams).recording.pushes.at(0).steps)
      for (const Observation& one : step.observations)
        if (const auto* frame = std::get_if<DepthFrame>(&one)) return frame->robot_is_masked;
    ADD_FAILURE() << "no image";
    return false;
  };
  EXPECT_FALSE(called_masked()) << "else nobody would mask the stick";
  streams.cameras[0].mask_robot = false;
  EXPECT_TRUE(called_masked()) << "nothing is to be masked";
}

TEST(FromStreams, PointsOfTheRobotAreLeftOutOfClouds) {
  SensorStreams streams = lab();
  for (const PoseSample& sample : streams.frames[0].samples)
    streams.joints.push_back({sample.time_s, {height_m(sample.time_s)}});
  streams.joint_names = {"lift"};
  CloudStream clouds;
  clouds.name = "/points";
  clouds.frame = "base";
  clouds.sigma_m = 0.001;
  for (int i = 0; i < 300; ++i) clouds.times_s.push_back(0.1 * i);
  clouds.cloud = [&](std::size_t i) {
    PointCloud cloud;
    cloud.points_m.resize(2, 3);
    cloud.points_m << 0.31, 0.1, height_m(0.1 * static_cast<double>(i)), 0.4, 0.1, 0;  // on the tip's box, and beside it
    return cloud;
  };
  streams.clouds.push_back(clouds);
  StreamPlan masked = stream_plan();
  masked.recording.robot = column();
  const auto fewest_and_most_points = [&] {
    std::pair<Index, Index> points{1000, 0};
    for (const Step& step : recording_from(masked, streams).recording.pushes.at(0).steps)
      for (const Observation& one : step.observations)
        if (const auto* cloud = std::get_if<PointCloud>(&one))
          points = {std::min<Index>(points.first, cloud->points_m.rows()), std::max<Index>(points.second, cloud->points_m.rows())};
    return points;
  };
  EXPECT_EQ(fewest_and_most_points(), (std::pair<Index, Index>(1, 1))) << "it is described and its pose is known";
  streams.clouds[0].mask_robot = false;
  EXPECT_EQ(fewest_and_most_points(), (std::pair<Index, Index>(2, 2)));
  streams.clouds[0].mask_robot = true;
  masked.recording.robot.reset();
  EXPECT_THAT(refusal(masked, streams), AllOf(HasSubstr("topics.clouds"), HasSubstr("mask_robot needs the robot")));
}

TEST(FromStreams, TheRobotIsMaskedWhereItStandsAndOnceAndOnlyIfItIsWanted) {
  SensorStreams streams = lab();
  // A gripper shares the topic; the column stands 10 m aside, far out of the picture.
  for (const PoseSample& sample : streams.frames[0].samples)
    streams.joints.push_back({sample.time_s, {0.02, height_m(sample.time_s)}});
  streams.joint_names = {"gripper", "lift"};
  Pose aside = Pose::Identity();
  aside.translation() = Vec3(10, 0, 0);
  StreamPlan masked = stream_plan();
  masked.recording.robot = column();
  masked.recording.robot->links.front().name = masked.recording.robot->joints.front().parent = "root";
  streams.frames.push_back({"base", "root", true, {{0, aside}}});
  const auto masked_pixels = [](const FromStreams& made) {
    int sum = 0;
    for (const Step& step : made.recording.pushes[0].steps) {
      EXPECT_LE(step.joints_rad.size(), 1u) << "the gripper's is not one of the robot's";
      for (const Observation& one : step.observations)
        if (const auto* frame = std::get_if<DepthFrame>(&one)) {
          EXPECT_TRUE(frame->robot_is_masked) << "else it would be masked again, as if it stood at the base";
          if (frame->mask.size() > 0) sum += frame->mask.cast<int>().sum();
        }
    }
    return sum;
  };
  streams.cameras[0].mask_robot = true;
  EXPECT_EQ(masked_pixels(recording_from(masked, streams)), 0);
  streams.frames.back().samples[0].T_parent_child = Pose::Identity();
  streams.frames[2].samples[0].T_parent_child.linear() = tip_at(0).linear();
  streams.frames[2].samples[0].T_parent_child.translation() = Vec3(0.3, 0.1, 0.5);
  streams.cameras[0].image = [](std::size_t) { return DepthImage(DepthImage::Constant(48, 64, 0.5f)); };
  EXPECT_GT(masked_pixels(recording_from(masked, streams)), 80);
  streams.cameras[0].mask_robot.reset();
  EXPECT_GT(masked_pixels(recording_from(masked, streams)), 80) << "it is described and its pose is known";
  streams.cameras[0].mask_robot = false;
  EXPECT_EQ(masked_pixels(recording_from(masked, streams)), 0);

  streams.cameras[0].mask_robot = true;
  streams.joint_names = {"gripper", "finger"};
  EXPECT_THAT(recording_from(masked, streams).notes, testing::Contains(HasSubstr("joint 'lift' is not in the joint states")));
  streams.joint_names = {"gripper", "lift"};
  std::erase_if(streams.joints, [](const JointSample& one) { return one.time_s > 10; });
  const auto notes = recording_from(masked, streams).notes;
  EXPECT_THAT(notes, testing::Contains(HasSubstr("there is no joint state near that time")));
  EXPECT_THAT(notes, testing::Not(testing::Contains(HasSubstr("is not in the joint states"))));
}

/// The column with a gripper that nobody tells anything of.
RobotModel column_with_finger() {
  RobotModel robot = column();
  RobotLink finger{"finger", {}, {}};
  RobotShape box;
  box.kind = RobotShape::Kind::box;
  box.size_m = Vec3(0.002, 0.002, 0.002);
  box.T_link_shape.translation() = Vec3(0.05, 0, 0);
  finger.visual.push_back(box);
  robot.links.push_back(finger);
  RobotJoint joint;
  joint.kind = RobotJoint::Kind::prismatic;
  joint.name = "finger_joint";
  joint.parent = "tip";
  joint.child = "finger";
  joint.axis = Vec3::UnitX();
  joint.lower = 0, joint.upper = 0.04;
  robot.joints.push_back(joint);
  return robot;
}

SensorStreams told_by_joints() {
  SensorStreams streams = lab();
  streams.joint_names = {"lift"};
  for (const PoseSample& sample : streams.frames[0].samples)
    streams.joints.push_back({sample.time_s, {height_m(sample.time_s)}});
  streams.frames.erase(streams.frames.begin());
  return streams;
}

TEST(FromStreams, AJointThatNobodyTellsHidesOnlyWhatHangsOnIt) {
  const SensorStreams streams = told_by_joints();
  StreamPlan by_joints = stream_plan();
  by_joints.recording.robot = column_with_finger();
  const auto made = recording_from(by_joints, streams).recording, expected = recording_from(stream_plan(), lab()).recording;
  ASSERT_EQ(made.pushes.size(), 1u);
  ASSERT_EQ(made.pushes[0].steps.size(), expected.pushes[0].steps.size());
  for (std::size_t i = 1; i + 1 < made.pushes[0].steps.size(); ++i)
    EXPECT_NEAR(travel_of(made.pushes[0].steps[i]), travel_of(expected.pushes[0].steps[i]), 1e-9);

  by_joints.tip_frame = "finger";
  by_joints.tip_where = "mapping.yaml:7: frames.tip";
  const std::string said = refusal(by_joints, streams);
  EXPECT_THAT(said, HasSubstr("mapping.yaml:7: frames.tip"));
  EXPECT_THAT(said, HasSubstr("frame 'finger'"));
  EXPECT_THAT(said, HasSubstr("joint 'finger_joint'"));
  EXPECT_THAT(said, HasSubstr("topics.joints"));
}

/// A driver tells where the flange is; what is bolted to it stands in the robot's description, and no joint is told.
TEST(FromStreams, WhatIsFixedToAKnownFrameNeedsNoJointStates) {
  SensorStreams streams = lab();
  streams.joints.clear(), streams.joint_names.clear();
  // The carriage by transforms, in place of the tip; the sensor stands on the description's tip.
  Pose T_carriage_tip = Pose::Identity();
  T_carriage_tip.linear() = tip_at(0).linear();
  streams.frames[0].child = "carriage";
  for (PoseSample& sample : streams.frames[0].samples) sample.T_parent_child = sample.T_parent_child * T_carriage_tip.inverse();
  StreamPlan described = stream_plan();
  described.recording.robot = column();
  const auto made = recording_from(described, streams).recording, expected = recording_from(stream_plan(), lab()).recording;
  ASSERT_EQ(made.pushes.size(), 1u);
  ASSERT_EQ(made.pushes[0].steps.size(), expected.pushes[0].steps.size());
  for (std::size_t i = 1; i + 1 < made.pushes[0].steps.size(); ++i) {
    EXPECT_NEAR(travel_of(made.pushes[0].steps[i]), travel_of(expected.pushes[0].steps[i]), 1e-9);
    EXPECT_LT((*made.pushes[0].steps[i].loads[0].force_n - *expected.pushes[0].steps[i].loads[0].force_n).norm(), 1e-9);
  }

  streams.frames.erase(streams.frames.begin());
  const std::string said = refusal(described, streams);
  EXPECT_THAT(said, HasSubstr("frame 'tip'"));
  EXPECT_THAT(said, HasSubstr("joint 'lift', and there are no joint states (topics.joints)"));
}

/// Who records /tf and the description and no joint states has told them all the same.
TEST(FromStreams, TransformsOfTheLinksTellTheJoints) {
  SensorStreams streams = lab();
  streams.joints.clear(), streams.joint_names.clear();
  const RobotModel robot = column();
  FrameLink& carriage = streams.frames[0];
  carriage.child = "carriage";
  for (PoseSample& sample : carriage.samples) {
    sample.T_parent_child = robot.joints[0].T_parent_joint;
    sample.T_parent_child.translation().z() += height_m(sample.time_s);
  }
  StreamPlan described = stream_plan();
  described.recording.robot = robot;
  const auto made = recording_from(described, streams).recording;
  ASSERT_EQ(made.joint_names, std::vector<std::string>{"lift"});
  std::size_t masked = 0;
  for (const Step& step : made.pushes.at(0).steps) {
    ASSERT_EQ(step.joints_rad.size(), 1u);
    EXPECT_NEAR(step.joints_rad[0], height_m(step.time_s), 1e-9);
    for (const Observation& one : step.observations)
      if (const auto* frame = std::get_if<DepthFrame>(&one)) masked += frame->robot_is_masked ? 1 : 0;
  }
  EXPECT_GT(masked, 0u);

  // A turn, between -pi and pi; and a link that is no such joint's tells nothing.
  described.recording.robot->joints[0].kind = RobotJoint::Kind::continuous;
  EXPECT_TRUE(recording_from(described, streams).recording.joint_names.empty());
  for (PoseSample& sample : carriage.samples) {
    sample.T_parent_child = robot.joints[0].T_parent_joint;
    sample.T_parent_child.linear() = Eigen::AngleAxisd(-3 + 0.001 * sample.time_s, Vec3::UnitZ()).toRotationMatrix();
  }
  const auto turned = with_joints_of_transforms(described.recording.robot, streams);
  ASSERT_TRUE(turned);
  ASSERT_EQ(turned->joints.size(), carriage.samples.size());
  EXPECT_NEAR(turned->joints.back().positions.at(0), -3 + 0.001 * carriage.samples.back().time_s, 1e-9);
}

/// A whole arm in the picture would be taken for the object.
TEST(FromStreams, LinksThatAreKnownAreMaskedWithoutThoseThatAreNot) {
  SensorStreams streams = lab();
  streams.joint_names = {"lift"};
  for (const PoseSample& sample : streams.frames[0].samples)
    streams.joints.push_back({sample.time_s, {height_m(sample.time_s)}});
  Pose above = Pose::Identity();
  above.linear() = tip_at(0).linear();
  above.translation() = Vec3(0.3, 0.1, 0.5);
  streams.frames[2].samples[0].T_parent_child = above;
  streams.cameras[0].like.camera = {64, 48, 200, 200, 31.5, 23.5, DistortionModel::none, {}};
  streams.cameras[0].image = [](std::size_t) { return DepthImage(DepthImage::Constant(48, 64, 0.5f)); };
  StreamPlan masked = stream_plan();
  masked.recording.robot = column_with_finger();
  const FromStreams made = recording_from(masked, streams);
  int frames = 0;
  for (const Step& step : made.recording.pushes[0].steps)
    for (const Observation& one : step.observations) {
      const auto* frame = std::get_if<DepthFrame>(&one);
      if (frame == nullptr) continue;
      ++frames;
      ASSERT_EQ(frame->mask.rows(), 48);
      EXPECT_EQ(frame->mask(24, 32), 1) << "the tool";
      EXPECT_EQ(frame->mask(24, 56), 0) << "where a closed finger would be";
    }
  EXPECT_GT(frames, 3);
  EXPECT_THAT(made.notes, testing::Contains(testing::AllOf(HasSubstr("'finger'"), HasSubstr("not masked"), HasSubstr("'finger_joint'"))));
}

/// Half a turn the short way is no turn back through everything.
TEST(FromStreams, AJointThatTurnsWithoutEndGoesTheShortWay) {
  SensorStreams streams = lab();
  streams.joint_names = {"lift", "turn", "elbow"};
  for (int i = 0; i <= 300; ++i) {
    const double one = i % 2 == 0 ? 3.13 : -3.13;
    streams.joints.push_back({0.1 * i + 0.003, {height_m(0.1 * i + 0.003), one, one}});
  }
  StreamPlan turning = stream_plan();
  RobotModel robot = column();
  RobotJoint joint;
  joint.kind = RobotJoint::Kind::continuous;
  joint.name = "turn";
  joint.parent = "tip";
  joint.child = "spindle";
  joint.axis = Vec3::UnitZ();
  robot.links.push_back({"spindle", {}, {}});
  robot.joints.push_back(joint);
  joint.kind = RobotJoint::Kind::revolute;
  joint.name = "elbow";
  joint.parent = "spindle";
  joint.child = "flap";
  joint.lower = -3.2, joint.upper = 3.2;
  robot.links.push_back({"flap", {}, {}});
  robot.joints.push_back(joint);
  turning.recording.robot = robot;
  streams.cameras.clear();
  bool went_back = false;
  const FromStreams made = recording_from(turning, streams);
  for (const Step& step : made.recording.pushes[0].steps) {
    ASSERT_EQ(step.joints_rad.size(), 3u);
    EXPECT_LT(std::cos(step.joints_rad[1]), std::cos(3.129)) << step.joints_rad[1];
    went_back |= std::cos(step.joints_rad[2]) > -0.9;
  }
  EXPECT_TRUE(went_back) << "a revolute joint has no other way";
}

}  // namespace
}  // namespace palpate::acquisition::stream_robot_test
