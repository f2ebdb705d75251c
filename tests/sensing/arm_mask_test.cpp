// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/arm_mask.hpp"

#include <gtest/gtest.h>

#include "palpate/sensing/images_at_rest.hpp"

namespace palpate::sensing::arm_mask_test {
namespace {

/// A disc of 20 mm above the middle of a camera's picture, 0.5 m away, before it touches and as it pushes.
Recording pushed_under_a_camera() {
  Recording recording;
  Tool pad;
  pad.name = "pad";
  pad.shape = ToolShape::disc;
  pad.radius_m = 0.02;
  recording.tools = {pad};
  Push push;
  push.name = "push";
  push.steps.resize(2);
  for (Step& step : push.steps) {
    step.T_base_tip = Pose(Eigen::Translation3d(0, 0, 0.3));
    DepthFrame frame;
    frame.camera = {64, 48, 100, 100, 31.5, 23.5, DistortionModel::none, {}};
    frame.noise.sigma_m = 1e-3;
    frame.T_base_camera.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;
    frame.T_base_camera.translation() = Vec3(0, 0, 1);
    frame.depth_m = DepthImage::Constant(48, 64, 0.5f);
    step.observations = {frame};
  }
  Load load;
  load.tool = "pad";
  load.force_n = Vec3(0, 0, -1);
  push.steps[1].loads = {load};
  recording.pushes = {push};
  return recording;
}

DepthFrame& image(Recording& recording, std::size_t step) {
  return std::get<DepthFrame>(recording.pushes[0].steps[step].observations[0]);
}

int masked_pixels(Recording& recording, std::size_t step) {
  const Push& push = recording.pushes[0];
  return ArmMask(recording).without_arm(image(recording, step), push, push.steps[step]).mask.cast<int>().sum();
}

TEST(ArmMask, TakesTheStickOutOfWhatNobodyMasked) {
  Recording recording = pushed_under_a_camera();
  const int stick = masked_pixels(recording, 0);  // 26 mm around its axis: 85 pixels of 5 mm
  EXPECT_NEAR(stick, 85, 10);
  EXPECT_EQ(masked_pixels(recording, 1), stick);
  const std::vector<DepthFrame> at_rest = images_at_rest(recording);
  ASSERT_EQ(at_rest.size(), 1u);
  EXPECT_EQ(at_rest[0].mask.cast<int>().sum(), stick);

  recording.tools[0].shape = ToolShape::platen;
  EXPECT_EQ(masked_pixels(recording, 1), 0);
  recording.tools[0].shape = ToolShape::sphere;
  recording.pushes[0].steps[1].T_base_tip.reset();
  EXPECT_EQ(masked_pixels(recording, 1), 0) << "where it is is not known";
}

TEST(ArmMask, LeavesWhatIsMasked) {
  Recording recording = pushed_under_a_camera();
  image(recording, 1).mask = MaskImage::Zero(48, 64);
  image(recording, 1).mask(0, 0) = 1;
  EXPECT_EQ(masked_pixels(recording, 1), 1);
  image(recording, 0).robot_is_masked = true;
  EXPECT_EQ(masked_pixels(recording, 0), 0);
}

TEST(ArmMask, TakesARobotByItsDescription) {
  Recording recording = pushed_under_a_camera();
  RobotShape ball;
  ball.kind = RobotShape::Kind::sphere;
  ball.size_m = Vec3(0.05, 0, 0);
  ball.T_link_shape = Eigen::Translation3d(0.05, 0, 0.5);
  recording.robot = RobotModel{};
  recording.robot->name = "ball";
  recording.robot->links = {{"base", {}, {}}, {"ball", {ball}, {}}};
  RobotJoint turn;
  turn.kind = RobotJoint::Kind::continuous;
  turn.name = "turn";
  turn.parent = "base";
  turn.child = "ball";
  recording.robot->joints = {turn};
  EXPECT_NEAR(masked_pixels(recording, 1), 85, 10) << "no joints were recorded: the stick";
  recording.joint_names = {"turn"};
  recording.pushes[0].steps[1].joints_rad = {0};
  EXPECT_GT(masked_pixels(recording, 1), 200) << "what it hides goes, too";
}

TEST(ArmMask, TakesTheStickOutOfClouds) {
  Recording recording = pushed_under_a_camera();
  PointCloud cloud;
  cloud.sigma_m = VectorX::Constant(1, 1e-3);
  cloud.points_m.resize(2, 3);
  cloud.points_m << 0.02, 0, 0.4, 0.03, 0, 0.4;
  const Push& push = recording.pushes[0];
  const PointCloud left = ArmMask(recording).without_arm(cloud, push, push.steps[0]);
  ASSERT_EQ(left.points_m.rows(), 1);
  EXPECT_EQ(left.points_m(0, 0), 0.03);
}

}  // namespace
}  // namespace palpate::sensing::arm_mask_test
