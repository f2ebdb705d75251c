// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/free_space.hpp"

#include <gtest/gtest.h>

#include <random>

#include "palpate/core/error.hpp"

namespace palpate::sensing::free_space_test {
namespace {

// A camera at the origin that looks along z; a wall at 1 m, in the middle a box at 0.5 m, a hole without depth, a masked patch.
DepthFrame scene() {
  DepthFrame frame;
  frame.camera.width_px = 64;
  frame.camera.height_px = 48;
  frame.camera.fx_px = frame.camera.fy_px = 60;
  frame.camera.cx_px = 32;
  frame.camera.cy_px = 24;
  frame.noise = {"constant", 0.001, 0};
  frame.depth_m = DepthImage::Constant(48, 64, 1.0F);
  frame.depth_m.block(18, 26, 12, 12).setConstant(0.5F);
  frame.depth_m.block(4, 4, 6, 6).setZero();
  frame.mask = MaskImage::Zero(48, 64);
  frame.mask.block(36, 50, 6, 6).setConstant(1);
  return frame;
}

Vec3 at(double column, double row, double z) { return {(column - 32) / 60 * z, (row - 24) / 60 * z, z}; }

TEST(FreeSpace, IsWhatTheCameraLookedThrough) {
  const FreeSpace free({scene()}, {4, 0.003});
  EXPECT_TRUE(free(at(10, 30, 0.9)));
  EXPECT_FALSE(free(at(10, 30, 0.995)));  // within 3 mm and four deviations of the wall
  EXPECT_FALSE(free(at(10, 30, 1.2)));    // behind it
  EXPECT_TRUE(free(at(32, 24, 0.48)));
  EXPECT_FALSE(free(at(32, 24, 0.6)));  // behind the box
  EXPECT_TRUE(free(at(45, 24, 0.6)));   // beside it
  EXPECT_FALSE(free(at(38, 24, 0.6)));  // right beside it: a neighbouring pixel shows the box
  EXPECT_FALSE(free(at(6, 6, 0.3)));    // no depth there
  EXPECT_FALSE(free(at(52, 38, 0.3)));  // masked
  EXPECT_FALSE(free(at(80, 24, 0.3)));  // out of the picture
  EXPECT_FALSE(free({0, 0, -0.3}));     // behind the camera
}

TEST(FreeSpace, AnotherViewFindsOutAndAnUncertainPoseKnowsLess) {
  DepthFrame side = scene();
  side.T_base_camera.translate(Vec3(-1, 0, 0.6)).rotate(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitY()));
  side.depth_m.setConstant(2.0F);
  const Vec3 behind_the_box = at(32, 24, 0.6);
  EXPECT_TRUE(FreeSpace({scene(), side})(behind_the_box));
  DepthFrame unsure = scene();
  unsure.pose_std_m = 0.03;
  EXPECT_FALSE(FreeSpace({unsure})(at(4, 40, 0.9)));
  EXPECT_TRUE(FreeSpace({unsure})(at(4, 40, 0.8)));
  // nor does a picture that may be 30 mm aside know what is free a few pixels beside the box
  EXPECT_TRUE(FreeSpace({scene()})(at(45, 24, 0.6)));
  EXPECT_FALSE(FreeSpace({unsure})(at(45, 24, 0.6)));
  unsure.pose_std_m = 0, unsure.pose_std_rad = 0.03;
  EXPECT_FALSE(FreeSpace({unsure})(at(43, 24, 0.6)));
  EXPECT_TRUE(FreeSpace({unsure})(at(52, 24, 0.6)));
}

// A camera half a metre above a table, noise of 4 mm, and on the table a box of 60 mm: what is free ends at the table and not four
// deviations above it, but not where the picture shows the box.
TEST(FreeSpace, ReachesDownToASupportThatIsSeen) {
  DepthFrame frame = scene();
  frame.depth_m = DepthImage::Constant(48, 64, 0.5F);
  frame.depth_m.block(18, 26, 12, 12).setConstant(0.44F);
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, 0.004F);
  for (Eigen::Index k = 0; k < frame.depth_m.size(); ++k) frame.depth_m.data()[k] += noise(random);
  frame.noise.sigma_m = 0.004;
  FreeSpaceOptions options;
  options.support = Plane{Vec3(0, 0, 0.5), -Vec3::UnitZ()};
  const FreeSpace alone({frame}), to_support({frame}, options);
  EXPECT_FALSE(alone(at(10, 30, 0.49)));
  EXPECT_TRUE(to_support(at(10, 30, 0.49)));
  EXPECT_FALSE(to_support(at(10, 30, 0.499)));
  EXPECT_FALSE(to_support(at(32, 24, 0.47)));
  EXPECT_FALSE(to_support(at(52, 38, 0.49)));  // masked
  // A table that is elsewhere than said is not seen: each depth for itself again.
  options.support->point_m.z() = 0.52;
  EXPECT_FALSE(FreeSpace({frame}, options)(at(10, 30, 0.505)));
}

TEST(FreeSpace, SaysWhatIsWrong) {
  EXPECT_THROW(FreeSpace({scene()}, {-1, 0}), Error);
  EXPECT_THROW(FreeSpace({scene()}, {4, -1}), Error);
  DepthFrame other = scene();
  other.depth_m = DepthImage::Constant(10, 10, 1.0F);
  EXPECT_THROW(FreeSpace({other}), Error);
}

}  // namespace
}  // namespace palpate::sensing::free_space_test
