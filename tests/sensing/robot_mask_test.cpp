// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/robot_mask.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"

namespace palpate::sensing::robot_mask_test {
namespace {

RobotShape shape(RobotShape::Kind kind, const Vec3& size) {
  RobotShape s;
  s.kind = kind;
  s.size_m = size;
  return s;
}

double volume(const TriMesh& mesh) {
  double six = 0;
  for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(mesh.vertices_m.row(mesh.triangles(t, k))); };
    six += corner(0).cross(corner(1)).dot(corner(2));
  }
  return six / 6;
}

TEST(RobotShapes, AreClosedOrientedAndNeverInsideTheTrueSurface) {
  const double box = volume(shape_mesh(shape(RobotShape::Kind::box, {0.1, 0.2, 0.3})));
  EXPECT_NEAR(box, 0.006, 1e-12);
  const double cylinder = volume(shape_mesh(shape(RobotShape::Kind::cylinder, {0.05, 0.4, 0})));
  EXPECT_GE(cylinder, M_PI * 0.0025 * 0.4);
  EXPECT_LT(cylinder, M_PI * 0.0025 * 0.4 * 1.01);
  const TriMesh ball = shape_mesh(shape(RobotShape::Kind::sphere, {0.2, 0, 0}));
  EXPECT_GE(volume(ball), 4 * M_PI / 3 * 0.008);
  EXPECT_LT(volume(ball), 4 * M_PI / 3 * 0.008 * 1.03);
  for (Eigen::Index t = 0; t < ball.triangles.rows(); ++t) {
    const Vec3 a = ball.vertices_m.row(ball.triangles(t, 0)), b = ball.vertices_m.row(ball.triangles(t, 1)),
               c = ball.vertices_m.row(ball.triangles(t, 2));
    const Vec3 normal = (b - a).cross(c - a);
    if (normal.norm() > 1e-12) {
      EXPECT_GE(normal.normalized().dot(a), 0.2 * (1 - 1e-9)) << "a facet cuts into the ball";
    }
  }
}

// A pendulum: a ball on a link of 0.5 m that swings about y.
RobotModel pendulum() {
  RobotModel robot;
  robot.name = "pendulum";
  RobotLink bob{"bob", {shape(RobotShape::Kind::sphere, {0.04, 0, 0})}, {shape(RobotShape::Kind::box, {0.2, 0.2, 0.2})}};
  bob.visual[0].T_link_shape = Eigen::Translation3d(0, 0, -0.5);
  bob.collision[0].T_link_shape = Eigen::Translation3d(0, 0, -0.5);
  robot.links = {{"hook", {}, {}}, bob};
  RobotJoint swing;
  swing.name = "swing";
  swing.parent = "hook";
  swing.child = "bob";
  swing.kind = RobotJoint::Kind::continuous;
  swing.axis = Vec3::UnitY();
  robot.joints.push_back(swing);
  return robot;
}

DepthFrame from_the_side(float background_m) {
  DepthFrame frame;
  frame.camera.width_px = 160;
  frame.camera.height_px = 120;
  frame.camera.fx_px = frame.camera.fy_px = 140;
  frame.camera.cx_px = 79.5;
  frame.camera.cy_px = 59.5;
  frame.depth_m = DepthImage::Constant(120, 160, background_m);
  frame.noise = {"constant", 0.001, 0};
  frame.T_base_camera.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;  // looks along +y
  frame.T_base_camera.translation() = Vec3(0, -1, -0.4);
  return frame;
}

TEST(RobotMask, FollowsTheJoint) {
  const RobotMask mask(pendulum());
  for (const double angle : {-0.5, 0.0, 0.4}) {
    const DepthFrame frame = from_the_side(1.5F);
    const MaskImage hidden = mask.mask(frame, {"swing"}, {angle});
    // The ball stands at (-0.5 sin, 0, -0.5 cos): one metre before the camera.
    const double u = 79.5 + 140 * -0.5 * std::sin(angle), v = 59.5 + 140 * (0.5 * std::cos(angle) - 0.4);
    EXPECT_EQ(hidden(int(std::lround(v)), int(std::lround(u))), 1) << angle;
    const double radius = std::sqrt(hidden.cast<double>().sum() / M_PI);
    EXPECT_GT(radius, 140 * 0.04);
    EXPECT_LT(radius, 140 * 0.04 + 3.5);
  }
}

/// A description holds the camera's housing: it stands around the lens, and hid the whole image.
TEST(RobotMask, TheCamerasOwnHousingHidesNothing) {
  RobotModel housed = pendulum();
  const DepthFrame frame = from_the_side(1.5F);
  RobotShape housing = shape(RobotShape::Kind::box, {0.09, 0.025, 0.025});
  housing.T_link_shape = Eigen::Translation3d(frame.T_base_camera.translation() - Vec3(0, 0.0083, 0));
  housed.links[0].visual = {housing};
  EXPECT_TRUE(RobotMask(housed).mask(frame, {"swing"}, {0.1}) == RobotMask(pendulum()).mask(frame, {"swing"}, {0.1}));
}

TEST(RobotMask, EncoderErrorWidensByItsLeverArm) {
  RobotMaskOptions sharp, loose;
  sharp.joint_std_rad = 0;
  loose.joint_std_rad = 0.04;  // 20 mm at half a metre, 40 mm at two sigma: 6 px
  const DepthFrame frame = from_the_side(1.5F);
  const auto radius = [&](const RobotMaskOptions& options) {
    return std::sqrt(RobotMask(pendulum(), options).mask(frame, {"swing"}, {0.0}).cast<double>().sum() / M_PI);
  };
  EXPECT_NEAR(radius(loose) - radius(sharp), 140 * 0.54 * 0.04 * 2, 1.5);  // to the ball's far side
}

TEST(RobotMask, CollisionGeometryIsAChoiceAndAFallback) {
  RobotMaskOptions options;
  options.geometry = RobotGeometry::collision;
  EXPECT_EQ(RobotMask(pendulum(), options).triangle_count(), 12);
  RobotModel bare = pendulum();
  bare.links[1].visual.clear();
  EXPECT_EQ(RobotMask(bare).triangle_count(), 12);
  bare.links[1].collision.clear();
  EXPECT_THROW(RobotMask{bare}, Error);
}

TEST(RobotMask, BadInputIsNamed) {
  RobotModel robot = pendulum();
  robot.links[1].visual[0].size_m.x() = 0;
  try {
    RobotMask mask(robot);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("link 'bob'"));
  }
  robot.links[1].visual[0].kind = RobotShape::Kind::mesh;
  EXPECT_THROW(RobotMask{robot}, Error);
  for (const int field : {0, 1, 2}) {
    RobotMaskOptions options;
    (field == 0 ? options.joint_std_rad : field == 1 ? options.base_std_m : options.pose_sigmas) = -1;
    EXPECT_THROW(RobotMask(pendulum(), options), Error);
  }
  EXPECT_THROW(RobotMask(pendulum()).mask(from_the_side(1), {"knee"}, {0}), Error);
}

}  // namespace
}  // namespace palpate::sensing::robot_mask_test
