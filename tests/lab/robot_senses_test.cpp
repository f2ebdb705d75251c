// label: unit
// SPDX-License-Identifier: Apache-2.0
// What the lab's robot sees, and from where: looks of things, light, a camera on the hand, an arm that stands elsewhere.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/object.hpp"
#include "palpate/lab/robot.hpp"
#include "palpate/sensing/back_projection.hpp"
#include "palpate/sensing/kinematics.hpp"

namespace palpate::lab::robot_senses_test {
namespace {

LabRobot robot_with(const LabOptions& options, double albedo = 0.5, double texture = 1) {
  ObjectOptions truth;
  truth.albedo = albedo;
  truth.texture = texture;
  return LabRobot(options, make_object("cube", truth));
}

LabOptions with_sensor(const char* name) {
  LabOptions options;
  options.depth = depth_sensor(name);
  options.camera_std_m = options.camera_std_rad = 0;
  return options;
}

/// Of a picture from above: the middle of the cube's top, 60 by 60 pixels.
DepthImage top(const DepthImage& picture) { return picture.block(picture.rows() / 2 - 30, picture.cols() / 2 - 30, 60, 60); }
const std::vector<LabRobot::ViewDirection> from_above{{0, 1.5}};

TEST(RobotSenses, StereoLosesPatchesOfAnObjectWithoutTexture) {
  const auto share = [&](double texture, const char* sensor) {
    double all = 0;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      LabOptions options = with_sensor(sensor);
      options.seed = seed;
      all += (top(robot_with(options, 0.5, texture).look_from(from_above)[0].depth_m).array() > 0).cast<double>().mean() / 4;
    }
    return all;
  };
  EXPECT_NEAR(share(1, "bumblebee"), 1, 0.01);
  EXPECT_NEAR(share(0.3, "bumblebee"), 0.3, 0.2);  // few patches an image
  EXPECT_EQ(share(0, "bumblebee"), 0);
  EXPECT_NEAR(share(0, "realsense_d435"), 1, 0.01) << "a projector brings its own texture";
}

TEST(RobotSenses, TimeOfFlightIsNoisierOnDarkObjectsAndInBrightLight) {
  double depth_m = 0;
  const auto spread = [&](double albedo, double light) {
    LabOptions options = with_sensor("time_of_flight");
    options.depth.ambient_light = light;
    options.depth.lens_scatter = 0;
    const DepthImage seen = top(robot_with(options, albedo).look_from(from_above)[0].depth_m);
    depth_m = seen.cast<double>().mean();
    return std::sqrt((seen.cast<double>().array() - seen.cast<double>().mean()).square().mean());
  };
  const double usual = spread(0.5, 1);
  EXPECT_NEAR(spread(0.125, 1) / usual, 2, 0.15);  // a quarter of the light of both kinds
  // The camera's own light falls with the square of the distance, ambient light does not: both are alike at a metre.
  const double own = 1 / (depth_m * depth_m);
  EXPECT_NEAR(spread(0.5, 7) / usual / std::sqrt((own + 7) / (own + 1)), 1, 0.05);
}

// Points of a picture that lie on the object, as far from it as they are.
std::vector<double> off_the_object_m(const DepthFrame& frame, const TriMesh& surface) {
  geometry::TriangleTree tree(surface);
  std::vector<double> off;
  const RayCloud rays = sensing::back_project(frame, {});
  for (Index i = 0; i < rays.range_m.size(); i += 7) {
    const Vec3 origin = rays.origins_m.row(i), direction = rays.directions.row(i);
    const auto hit = tree.cast(origin, direction);
    if (hit && std::abs(hit->range_m - rays.range_m(i)) < 0.02) off.push_back(rays.range_m(i) - hit->range_m);
  }
  return off;
}

double mean(const std::vector<double>& of) {
  double sum = 0;
  for (const double each : of) sum += each;
  return sum / double(of.size());
}

TEST(RobotSenses, ACameraOnTheHandGoesWhereTheJointsSay) {
  LabOptions options = with_sensor("realsense_d435");
  options.camera_on_hand = true;
  options.joint_std_rad = 0;
  LabRobot robot = robot_with(options);
  const acquisition::PushPlan plan = robot.plan();
  Pose tip = Pose::Identity();
  tip.linear() = plan.R_base_tip;
  std::vector<Vec3> stood;
  for (const double before_m : {0.05, 0.02}) {
    tip.translation() = plan.contact_m - before_m * plan.direction;
    ASSERT_EQ(robot.move(tip, 0.1), acquisition::Motion::done);
    const DepthFrame frame = robot.take_depth_image();
    const sensing::Kinematics arm(*robot.scene().robot);
    const Pose stated = arm.link_poses(robot.scene().joint_names, robot.read().joints_rad)[std::size_t(arm.link("camera"))];
    EXPECT_TRUE(frame.T_base_camera.isApprox(stated, 1e-12));
    stood.push_back(frame.T_base_camera.translation());
    // The contact is in view.
    const Vec3 seen = frame.T_base_camera.inverse() * plan.contact_m;
    EXPECT_GT(seen.z(), 0.2);
    EXPECT_LT(std::abs(frame.camera.fx_px * seen.x() / seen.z()), 0.5 * frame.camera.width_px);
    EXPECT_LT(std::abs(frame.camera.fy_px * seen.y() / seen.z()), 0.5 * frame.camera.height_px);
    EXPECT_GT(frame.mask.cast<int>().sum(), 1000) << "the stick stands before the camera";
    const std::vector<double> off = off_the_object_m(frame, robot.object().surface);
    ASSERT_GT(off.size(), 1000u);
    EXPECT_NEAR(mean(off), 0, 2e-4);
  }
  EXPECT_NEAR((stood[0] - stood[1]).norm(), 0.03, 1e-4) << "it came along";
}

TEST(RobotSenses, WhatAJointErrsByIsStatedForTheCameraThatItCarries) {
  LabOptions options = with_sensor("realsense_d435");
  options.camera_on_hand = true;
  double square = 0, stated = 0;
  constexpr int motions = 12;
  for (int k = 0; k < motions; ++k) {
    options.seed = std::uint64_t(k + 1);
    LabRobot robot = robot_with(options);
    const acquisition::PushPlan plan = robot.plan();
    Pose tip = Pose::Identity();
    tip.linear() = plan.R_base_tip;
    tip.translation() = plan.contact_m - 0.03 * plan.direction;
    ASSERT_EQ(robot.move(tip, 0.1), acquisition::Motion::done);
    const DepthFrame frame = robot.take_depth_image();
    square += std::pow(mean(off_the_object_m(frame, robot.object().surface)), 2) / motions;
    stated += frame.pose_std_m / motions;
  }
  EXPECT_GT(stated, 1e-4);
  // Along the rays: one direction of a place and the lever of its turns.
  EXPECT_LT(std::sqrt(square), 3 * stated);
  EXPECT_GT(std::sqrt(square), 0.3 * stated);
}

// Torque about the tip over force: how far beside the tip the force acts. Here the tip errs by what the joints do, a slip by 5 mm.
TEST(RobotSenses, TorqueSaysWhereTheForceActs) {
  LabOptions options = with_sensor("realsense_d435");
  options.force = force_sensor("ideal");
  options.force.bias_n = options.force.scale_std = options.force.torque_bias_nm = 0;
  options.force.tool_mass_kg = 0;
  options.relaxation = 0;
  options.joint_std_rad = 0;
  LabRobot robot = robot_with(options);
  const acquisition::PushPlan plan = robot.plan();
  const auto torque_with_tip = [&](double aside_m, double deep_m) {
    Pose tip = Pose::Identity();
    tip.linear() = plan.R_base_tip;
    tip.translation() = plan.contact_m + deep_m * plan.direction + aside_m * Vec3::UnitY();
    EXPECT_EQ(robot.move(tip, 0.1), acquisition::Motion::done);
    return robot.read();
  };
  const acquisition::RobotState straight = torque_with_tip(0, 0.008), aside = torque_with_tip(0.004, 0.008);
  ASSERT_TRUE(straight.torque_nm && aside.torque_nm);
  EXPECT_GT(straight.force_n.norm(), 2);
  EXPECT_LT(straight.torque_nm->norm() / straight.force_n.norm(), 2e-4);
  // The pad is soft and stays on the object where it was put: the tip stands 4 mm beside the middle of its pressure.
  EXPECT_NEAR((*aside.torque_nm + 0.004 * Vec3::UnitY().cross(aside.force_n)).norm() / aside.force_n.norm(), 0, 2e-4);
}

// The protocol records it where the contact is not exactly known, free of its tare: here the force acts within what is stated of the tip.
TEST(RobotSenses, TorquesAreRecordedWhereTheySaySomething) {
  const auto push_with = [](double contact_std_m) {
    LabRobot robot = robot_with(with_sensor("realsense_d435"));
    acquisition::PushOptions protocol;
    protocol.travel_limit_m = 0.006;
    protocol.force_step_n = robot.object().force_step_n;
    protocol.unloading_steps = 1;
    protocol.contact_std_m = contact_std_m;
    return acquisition::whole_push(robot, robot.plan(), protocol);
  };
  int told = 0;
  const Push push = push_with(0.002);
  EXPECT_GT(push.torque_tare_std_nm, 0);
  for (const Step& step : push.steps)
    for (const Observation& seen : step.observations)
      if (const auto* wrench = std::get_if<Wrench>(&seen)) {
        ++told;
        ASSERT_TRUE(wrench->has_torque);
        EXPECT_EQ(wrench->force_n, *step.loads[0].force_n);
        // The tool weighs 3 N at 0.15 m and the sensor's zero is 0.05 N m off: none of that is left.
        EXPECT_LT(wrench->torque_nm.norm(), 5 * wrench->torque_sigma_nm);
        EXPECT_GT(wrench->torque_sigma_nm, 1e-5);
        EXPECT_LT(wrench->torque_sigma_nm, 2e-3 * wrench->force_n.norm());
      }
  EXPECT_EQ(told, int(std::count_if(push.steps.begin(), push.steps.end(), [](const Step& step) { return !step.loads.empty(); })));
  for (const Step& step : push_with(0).steps)
    for (const Observation& seen : step.observations) EXPECT_FALSE(std::holds_alternative<Wrench>(seen));
}

TEST(RobotSenses, AnArmThatStandsElsewhereMakesTheSamePush) {
  const auto push_of = [](const LabOptions& options) {
    LabRobot robot = robot_with(options);
    acquisition::PushOptions protocol;
    protocol.travel_limit_m = 0.006;
    protocol.force_step_n = robot.object().force_step_n;
    protocol.unloading_steps = 0;
    return acquisition::whole_push(robot, robot.plan(), protocol);
  };
  LabOptions usual, moved;
  usual.joint_std_rad = moved.joint_std_rad = 0;
  usual.force = moved.force = force_sensor("ideal");
  moved.T_base_arm.translation() = Vec3(0.9, 0.55, 0);
  moved.T_base_arm.rotate(Eigen::AngleAxisd(-1.9, Vec3::UnitZ()));
  const Push a = push_of(usual), b = push_of(moved);
  ASSERT_EQ(a.steps.size(), b.steps.size());
  ASSERT_GT(a.steps.size(), 1u);
  for (std::size_t s = 0; s < a.steps.size(); ++s) {
    EXPECT_NE(a.steps[s].joints_rad, b.steps[s].joints_rad);
    EXPECT_TRUE(a.steps[s].T_base_tip->translation().isApprox(b.steps[s].T_base_tip->translation(), 2e-3));
    if (a.steps[s].loads.empty()) continue;
    const Vec3 one = *a.steps[s].loads[0].force_n, other = *b.steps[s].loads[0].force_n;
    EXPECT_LT((one - other).norm(), 0.1 * one.norm());
  }
  LabRobot robot = robot_with(moved);
  const sensing::Kinematics arm(*robot.scene().robot);
  const auto poses = arm.link_poses(robot.scene().joint_names, std::vector<double>(7, 0.1));
  EXPECT_TRUE(poses[std::size_t(arm.link("arm_base"))].isApprox(moved.T_base_arm, 1e-12)) << "a recording's robot stands there, too";
}

TEST(RobotSenses, OptionsThatContradictAreRefused) {
  LabOptions options;
  options.camera_on_hand = true;
  options.T_base_camera = Pose::Identity();
  EXPECT_THROW(check(options), Error);
}

}  // namespace
}  // namespace palpate::lab::robot_senses_test
