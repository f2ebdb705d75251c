// label: unit
// SPDX-License-Identifier: Apache-2.0
// Streams of a made-up lab whose truth is known in closed form: a spring that is pressed in stages, seen by a sensor that is
// mounted askew, biased and late.
#include "palpate/acquisition/from_streams.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "palpate/acquisition/find_pushes.hpp"
#include "palpate/acquisition/frame_tree.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition {
namespace {

using testing::HasSubstr;

constexpr double stiffness_n_m = 400, top_m = 0.1;

/// Height of the tip: down in stages of 5 mm from 2 cm above the object, up again in two.
double height_m(double time_s) {
  struct Stage {
    double until_s, to_m;
  };
  // Each stage moves at 10 mm/s and then stands.
  const Stage stages[] = {{4, 0.12}, {8, 0.095}, {12, 0.09}, {16, 0.085}, {20, 0.08}, {24, 0.09}, {30, 0.12}};
  double height = 0.12, begin = 0;
  for (const Stage& stage : stages) {
    const double way = stage.to_m - height, duration = std::abs(way) / 0.01;
    if (time_s < stage.until_s) return height + way * (duration > 0 ? std::min(1.0, (time_s - begin) / duration) : 1.0);
    height = stage.to_m;
    begin = stage.until_s;
  }
  return height;
}
double force_n(double time_s) { return stiffness_n_m * std::max(0.0, top_m - height_m(time_s)); }

struct LabOptions {
  double wrench_late_s = 0, camera_late_s = 0;
  double noise_n = 0.02;
  Vec3 bias_n{1.5, -0.7, 3};
};

Pose tip_at(double time_s) {
  Pose pose = Pose::Identity();
  pose.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;  // z down
  pose.translation() = Vec3(0.3, 0.1, height_m(time_s));
  return pose;
}

/// The camera looks down; its picture is the tool as a square patch at the tip's depth before a plane 1 m away.
DepthImage picture(double time_s) {
  DepthImage image = DepthImage::Constant(48, 64, 1.0f);
  image.block(20, 20, 10, 10).setConstant(static_cast<float>(0.9 - height_m(time_s)));
  image.block(5, 30 + static_cast<int>(std::lround(1000 * height_m(time_s))) % 20, 10, 4).setConstant(0.7f);
  return image;
}

SensorStreams lab(const LabOptions& options = {}) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  SensorStreams streams;
  FrameLink tip{"base", "tip", false, {}}, sensor{"tip", "sensor", true, {}}, camera{"base", "camera", true, {}};
  for (int i = 0; i <= 3000; ++i) tip.samples.push_back({0.01 * i, tip_at(0.01 * i)});
  Pose askew = Pose::Identity();
  askew.rotate(Eigen::AngleAxisd(0.8, Vec3(1, 2, 3).normalized()));
  sensor.samples.push_back({0, askew});
  camera.samples.push_back({0, Pose::Identity()});
  streams.frames = {tip, sensor, camera};
  streams.wrench_frame = "sensor";
  for (int i = 0; i < 6000; ++i) {
    const double time = 0.005 * i;
    const Vec3 on_object(0, 0, -force_n(time));
    const Mat3 R_base_sensor = tip_at(time).linear() * askew.linear();
    const Vec3 noise(normal(random), normal(random), normal(random));
    streams.wrenches.push_back({time + options.wrench_late_s,
                                -(R_base_sensor.transpose() * on_object) + options.bias_n + options.noise_n * noise,
                                Vec3::Zero()});
  }
  DepthStream depth;
  depth.name = "/depth";
  depth.frame = "camera";
  depth.like.camera = {64, 48, 50, 50, 31.5, 23.5, DistortionModel::none, {}};
  depth.like.noise.sigma_m = 0.002;
  for (int i = 0; i < 900; ++i) depth.times_s.push_back(i / 30.0 + options.camera_late_s);
  depth.image = [late = options.camera_late_s, times = depth.times_s](std::size_t i) { return picture(times[i] - late); };
  streams.cameras.push_back(depth);
  streams.end_s = 30;
  return streams;
}

StreamPlan plan() {
  StreamPlan plan;
  plan.base_frame = "base";
  plan.tip_frame = "tip";
  plan.any_push.tool = "stick";
  plan.any_push.travel_sigma_m = {0.0005};
  Tool stick;
  stick.name = "stick";
  plan.recording.tools.push_back(stick);
  plan.source = "mapping.yaml";
  return plan;
}

double travel_of(const Step& step) {
  for (const Observation& one : step.observations)
    if (const auto* travel = std::get_if<ToolTravel>(&one)) return travel->travel_m;
  return std::nan("");
}

TEST(FromStreams, FindsThePushItsStepsAndItsUnloading) {
  const FromStreams made = recording_from(plan(), lab());
  ASSERT_EQ(made.recording.pushes.size(), 1u);
  const Push& push = made.recording.pushes[0];
  // Before, four stages down, one up, after.
  ASSERT_EQ(push.steps.size(), 7u);
  EXPECT_TRUE(push.steps.front().loads.empty());
  EXPECT_FALSE(push.steps.front().unloading);
  EXPECT_TRUE(push.steps.back().loads.empty());
  EXPECT_TRUE(push.steps.back().unloading);
  const double expected_n[] = {2, 4, 6, 8, 4};
  for (std::size_t i = 0; i < 5; ++i) {
    const Step& step = push.steps[i + 1];
    ASSERT_EQ(step.loads.size(), 1u);
    const Load& load = step.loads[0];
    // The mean of 100 samples of 0.02 N against a tare of 200: five standard deviations.
    EXPECT_LT((*load.force_n - Vec3(0, 0, -expected_n[i])).norm(), 5 * 0.02 * std::sqrt(3 * (1 / 100. + 1 / 200.))) << i;
    EXPECT_NEAR(load.force_std_n, 0.02 / 10, 0.0008);
    EXPECT_NEAR(load.contact_m.z(), top_m, 0.001) << "noticed at 0.3 N: 0.75 mm";
    EXPECT_LT((load.direction - Vec3(0, 0, -1)).norm(), 1e-9);
    EXPECT_NEAR(travel_of(step), expected_n[i] / stiffness_n_m, 0.001);
    EXPECT_EQ(step.unloading, i == 4);
    EXPECT_EQ(load.tool, "stick");
    bool seen = false;
    for (const Observation& one : step.observations) {
      const auto* frame = std::get_if<DepthFrame>(&one);
      if (frame == nullptr) continue;
      seen = true;
      EXPECT_LT(std::abs(frame->time_s - step.time_s), 0.02);
      EXPECT_EQ(frame->depth_m, picture(frame->time_s));
    }
    EXPECT_TRUE(seen);
  }
  EXPECT_NEAR(push.force_tare_std_n, 0.02 / std::sqrt(200.0), 0.0005);
}

TEST(FromStreams, AForceOnTheObjectKeepsItsSign) {
  SensorStreams streams = lab();
  for (WrenchSample& one : streams.wrenches) one.force_n = -one.force_n;
  StreamPlan on_object = plan();
  on_object.force_on_object = true;
  EXPECT_NEAR(recording_from(on_object, streams).recording.pushes[0].steps[4].loads[0].force_n->z(), -8, 0.02);
  StreamPlan wrong = plan();
  try {
    recording_from(wrong, streams);
    FAIL() << "a force of the wrong sign is no contact";
  } catch (const Error& error) {
    EXPECT_THAT(error.message(), HasSubstr("sign"));
  }
}

TEST(FromStreams, TimesAndMarksChooseTheSteps) {
  StreamPlan times = plan();
  times.steps_by = StepsBy::times;
  PlannedPush push = times.any_push;
  push.name = "head";
  push.site = "head";
  push.at_s = {3, 7.5, 15.5, 23.5};
  times.pushes = {push};
  const FromStreams made = recording_from(times, lab());
  ASSERT_EQ(made.recording.pushes.size(), 1u);
  const auto& steps = made.recording.pushes[0].steps;
  ASSERT_EQ(steps.size(), 4u);
  EXPECT_TRUE(steps[0].loads.empty()) << "in free air";
  EXPECT_NEAR(steps[2].loads[0].force_n->z(), -6, 0.02);
  EXPECT_TRUE(steps[3].unloading);
  EXPECT_EQ(made.recording.pushes[0].site, "head");

  StreamPlan marks = plan();
  marks.steps_by = StepsBy::marks;
  marks.pushes = {push};
  SensorStreams streams = lab();
  streams.marks = {{3, "head; unloaded"}, {7.5, "head"}, {15.5, "head; unloading"}};
  const auto marked = recording_from(marks, streams).recording.pushes;
  ASSERT_EQ(marked.size(), 1u);
  EXPECT_EQ(marked[0].site, "head");
  EXPECT_TRUE(marked[0].steps[0].loads.empty());
  EXPECT_TRUE(marked[0].steps[2].unloading) << "the mark says so";
}

TEST(FromStreams, AForceOnItsWayIsThatOfTheImage) {
  StreamPlan moving = plan();
  moving.steps_by = StepsBy::times;
  moving.pushes = {moving.any_push};
  moving.pushes[0].name = "away";
  moving.pushes[0].at_s = {23.5, 24.79};  // standing; going back at 10 mm/s, the image is of 24.8 s
  const FromStreams made = recording_from(moving, lab());
  const auto& steps = made.recording.pushes.at(0).steps;
  ASSERT_EQ(steps.size(), 2u);
  EXPECT_TRUE(steps[0].loads.at(0).force_rate_n_s.isZero(0));
  const Load& load = steps[1].loads.at(0);
  EXPECT_NEAR(load.force_n->z(), -force_n(24.8), 0.02) << "the mean over half a second is a newton more";
  EXPECT_NEAR(load.force_rate_n_s.z(), 4, 0.1);
  EXPECT_LT(load.force_rate_n_s.head<2>().norm(), 0.1);
  EXPECT_GT(load.force_std_n, 1e-3);
  EXPECT_LT(load.force_std_n, 0.01) << "of a line through a hundred samples of 0.02 N, at its end";
  EXPECT_NEAR(travel_of(steps[0]) - travel_of(steps[1]), height_m(24.8) - height_m(23.5), 1e-4);
  EXPECT_THAT(made.notes, testing::Contains(HasSubstr("the force was changing in 1 step, the first at 24.790 s")));
}

TEST(FromStreams, WhatEstimatedClocksLeaveIsStated) {
  StreamPlan aligned = plan();
  aligned.camera_clock.estimate = true;
  aligned.recording.time_offset_std_s = 0.003;
  const FromStreams made = recording_from(aligned, lab());
  ASSERT_EQ(made.clocks.size(), 1u);
  EXPECT_NEAR(made.recording.time_offset_std_s, std::hypot(0.003, made.clocks[0].std_s), 1e-12);
}

TEST(FromStreams, LateClocksAreFoundAndTakenOff) {
  for (const double late_s : {-0.21, 0.0, 0.13}) {
    LabOptions options;
    options.camera_late_s = late_s;
    options.wrench_late_s = -0.5 * late_s;
    StreamPlan aligned = plan();
    aligned.camera_clock.estimate = true;
    aligned.wrench_clock.estimate = true;
    const FromStreams made = recording_from(aligned, lab(options));
    ASSERT_EQ(made.clocks.size(), 2u);
    EXPECT_EQ(made.clocks[0].sensor, "force");
    EXPECT_TRUE(made.clocks[0].usable);
    EXPECT_NEAR(made.clocks[0].offset_s, 0.5 * late_s, 0.01) << "a bin is 20 ms, noise hides the ends of motions";
    EXPECT_TRUE(made.clocks[1].usable);
    EXPECT_NEAR(made.clocks[1].offset_s, -late_s, 0.02) << "an image is 33 ms";
    EXPECT_LT(std::abs(made.clocks[1].offset_s + late_s), 5 * made.clocks[1].std_s + 0.01);
  }
}

TEST(FromStreams, AClockThatCannotBeFoundIsLeftAlone) {
  SensorStreams streams = lab();
  streams.cameras[0].image = [](std::size_t) { return DepthImage(DepthImage::Constant(48, 64, 1.0f)); };
  StreamPlan aligned = plan();
  aligned.camera_clock.estimate = true;
  const FromStreams made = recording_from(aligned, streams);
  EXPECT_FALSE(made.clocks[0].usable);
  EXPECT_THAT(made.notes, testing::Contains(HasSubstr("could not be aligned")));
}

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

TEST(FromStreams, WithoutTransformsOfTheTipTheJointsTellWhereItIs) {
  SensorStreams streams = lab();
  FrameLink& tip = streams.frames[0];
  streams.joint_names = {"gripper_of_another_device", "lift"};
  for (const PoseSample& sample : tip.samples) streams.joints.push_back({sample.time_s, {0.5, height_m(sample.time_s)}});
  streams.frames.erase(streams.frames.begin());
  StreamPlan by_joints = plan();
  by_joints.recording.robot = column();
  const auto with_joints = recording_from(by_joints, streams).recording.pushes,
             with_frames = recording_from(plan(), lab()).recording.pushes;
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
  StreamPlan masked = plan();
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

TEST(FromStreams, TheRobotIsMaskedWhereItStandsAndOnceAndOnlyIfItIsWanted) {
  SensorStreams streams = lab();
  // A gripper shares the topic; the column stands 10 m aside, far out of the picture.
  for (const PoseSample& sample : streams.frames[0].samples)
    streams.joints.push_back({sample.time_s, {0.02, height_m(sample.time_s)}});
  streams.joint_names = {"gripper", "lift"};
  Pose aside = Pose::Identity();
  aside.translation() = Vec3(10, 0, 0);
  StreamPlan masked = plan();
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
}

TEST(FromStreams, ATareWhereNothingWasMeasuredIsRefused) {
  StreamPlan wrong = plan();
  wrong.tare = Tare::between;
  wrong.tare_from_s = 1000;
  wrong.tare_to_s = 1001;
  try {
    recording_from(wrong, lab());
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("wrench.tare"), HasSubstr("no force was measured"), HasSubstr("29.99")));
  }
}

/// The same sensor with its sign turned by its driver, a tool of 2 kg on it: either report gives the force on the object.
TEST(FromStreams, TheToolsWeightIsTakenOffWhateverTheSensorReports) {
  LabOptions quiet;
  quiet.bias_n.setZero();
  SensorStreams streams = lab(quiet);
  const Vec3 weight(0, 0, -2 * 9.81);
  const Mat3 R_tip_sensor = streams.frames[1].samples[0].T_parent_child.linear();
  for (WrenchSample& sample : streams.wrenches) sample.force_n += (tip_at(sample.time_s).linear() * R_tip_sensor).transpose() * weight;
  StreamPlan heavy = plan();
  heavy.tare = Tare::none;
  heavy.tool_mass_kg = 2;
  const auto on_sensor = recording_from(heavy, streams).recording.pushes.at(0);
  for (WrenchSample& sample : streams.wrenches) sample.force_n *= -1;
  heavy.force_on_object = true;
  const auto on_object = recording_from(heavy, streams).recording.pushes.at(0);
  ASSERT_EQ(on_sensor.steps.size(), on_object.steps.size());
  for (std::size_t i = 1; i + 1 < on_object.steps.size(); ++i) {
    const Vec3 force = *on_object.steps[i].loads.at(0).force_n;
    EXPECT_LT((force - *on_sensor.steps[i].loads.at(0).force_n).norm(), 1e-9);
    EXPECT_NEAR(force.z(), -force_n(on_object.steps[i].time_s), 0.05);
  }
}

TEST(FromStreams, AClockThatCloudsCannotTellIsSaid) {
  SensorStreams streams = lab();
  CloudStream clouds;
  clouds.name = "/points";
  clouds.frame = "camera";
  clouds.sigma_m = 0.001;
  clouds.times_s = streams.cameras[0].times_s;
  clouds.cloud = [](std::size_t) {
    PointCloud cloud;
    cloud.points_m.setZero(1, 3);
    return cloud;
  };
  streams.cameras.clear();
  streams.clouds.push_back(clouds);
  StreamPlan late = plan();
  late.camera_clock.estimate = true;
  EXPECT_THAT(recording_from(late, streams).notes, testing::Contains(HasSubstr("there are clouds only")));
}

TEST(FromStreams, CloudsComeIntoTheBaseFrame) {
  SensorStreams streams = lab();
  Pose pose = Pose::Identity();
  pose.rotate(Eigen::AngleAxisd(0.4, Vec3::UnitY()));
  pose.pretranslate(Vec3(0, 0, 1));
  streams.frames[2].samples[0].T_parent_child = pose;
  CloudStream clouds;
  clouds.name = "/points";
  clouds.frame = "camera";
  clouds.sigma_m = 0.001;
  for (int i = 0; i < 300; ++i) clouds.times_s.push_back(0.1 * i);
  clouds.cloud = [](std::size_t i) {
    PointCloud cloud;
    cloud.points_m.resize(2, 3);
    cloud.points_m << 0.1 * static_cast<double>(i), 0, 0, 0, 0.2, 0.3;
    return cloud;
  };
  streams.clouds.push_back(clouds);
  const auto steps = recording_from(plan(), streams).recording.pushes.at(0).steps;
  std::size_t seen = 0;
  for (const Step& step : steps) {
    for (const Observation& one : step.observations) {
      const auto* cloud = std::get_if<PointCloud>(&one);
      if (cloud == nullptr) continue;
      ++seen;
      EXPECT_LT((Vec3(cloud->points_m.row(1)) - pose * Vec3(0, 0.2, 0.3)).norm(), 1e-12);
      const double i = (pose.inverse() * Vec3(cloud->points_m.row(0))).x() / 0.1;
      EXPECT_NEAR(0.1 * i, step.time_s, 0.051) << "the cloud nearest in time";
      EXPECT_EQ(cloud->sigma_m[0], 0.001);
    }
  }
  EXPECT_EQ(seen, steps.size());
}

TEST(FromStreams, WhatIsMissingIsSaidWithACure) {
  const auto message = [](const StreamPlan& asked, const SensorStreams& streams) -> std::string {
    try {
      recording_from(asked, streams);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing";
  };
  StreamPlan other = plan();
  other.tip_frame = "flange";
  EXPECT_THAT(message(other, lab()), testing::AllOf(HasSubstr("'flange'"), HasSubstr("base, camera, sensor, tip")));
  SensorStreams moving = lab();
  StreamPlan patient = plan();
  patient.hold_s = 5;
  EXPECT_THAT(message(patient, moving), HasSubstr("stood still"));
  moving.cameras[0].image = [](std::size_t) -> DepthImage { throw Error("is damaged", "m"); };
  const FromStreams made = recording_from(plan(), moving);
  EXPECT_THAT(made.notes, testing::Contains(HasSubstr("is damaged")));
  EXPECT_EQ(made.recording.pushes[0].steps.size(), 7u) << "the steps have their force and travel still";
}

TEST(FrameTree, InterpolatesAndClosesThePath) {
  Pose turned = Pose::Identity();
  turned.translate(Vec3(1, 0, 0)).rotate(Eigen::AngleAxisd(1.0, Vec3::UnitZ()));
  const FrameTree tree({{"base", "arm", false, {{0, Pose::Identity()}, {1, turned}}},
                        {"base", "camera", true, {{0, Pose(Eigen::Translation3d(0, 0, 2))}}},
                        {"elsewhere", "lost", true, {{0, Pose::Identity()}}}});
  const auto half = tree.lookup("base", "arm", 0.25);
  ASSERT_TRUE(half);
  EXPECT_TRUE(half->translation().isApprox(Vec3(0.25, 0, 0)));
  EXPECT_TRUE(half->linear().isApprox(Eigen::AngleAxisd(0.25, Vec3::UnitZ()).toRotationMatrix(), 1e-12));
  EXPECT_EQ(tree.lookup("base", "arm", 1)->matrix(), turned.matrix()) << "a sample comes back as it is";
  const auto across = tree.lookup("camera", "arm", 0.25);
  EXPECT_TRUE(across->translation().isApprox(Vec3(0.25, 0, -2)));
  EXPECT_TRUE((*tree.lookup("arm", "camera", 0.25) * *across).isApprox(Pose::Identity(), 1e-12));
  EXPECT_FALSE(tree.lookup("base", "lost", 0));
  EXPECT_FALSE(tree.connects("base", "lost"));
  EXPECT_FALSE(tree.lookup("base", "arm", 1.5)) << "long after the last sample";
  EXPECT_TRUE(tree.lookup("base", "arm", 1.01));
}

TEST(FrameTree, AGapIsNotBridged) {
  const FrameTree tree({{"base", "arm", false, {{0, Pose::Identity()}, {10, Pose(Eigen::Translation3d(1, 0, 0))}}}});
  EXPECT_FALSE(tree.lookup("base", "arm", 5));
  EXPECT_EQ(tree.lookup("base", "arm", 9.99)->translation().x(), 1);
}

TEST(FindContacts, ADriftingBiasIsTaredAnewForEachPush) {
  Track track;
  for (int i = 0; i < 6000; ++i) {
    const double time = 0.01 * i;
    const double pressing = (time > 10 && time < 15) || (time > 40 && time < 45) ? 5 : 0;
    const double depth = pressing > 0 ? std::min(0.01 * (time < 30 ? time - 10 : time - 40), 0.02) : 0;
    track.samples.push_back({time, Vec3(0.02 * time, 0, -pressing - 0.01 * time), Vec3(0, 0, -depth)});
    track.direction.push_back(-Vec3::UnitZ());
  }
  const auto spans = find_contacts(track, plan());
  ASSERT_EQ(spans.size(), 2u);
  EXPECT_NEAR(spans[0].tare_n.z(), -0.01 * 9.4, 0.005);
  EXPECT_NEAR(spans[1].tare_n.z(), -0.01 * 39.4, 0.005);
  EXPECT_NEAR(track.samples[spans[1].begin].time_s, 40, 0.05);
}

}  // namespace
}  // namespace palpate::acquisition
