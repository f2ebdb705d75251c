// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/stick_mask.hpp"

#include <gtest/gtest.h>

namespace palpate::sensing::stick_mask_test {
namespace {

constexpr double sigma_m = 1e-3;

TEST(Sticks, AreTakenOutFromTheirTipsOn) {
  // On the axis of a stick that comes along x and ends at the origin, beside it, and before it.
  PointCloud cloud;
  cloud.sigma_m = VectorX::Constant(1, sigma_m);
  cloud.points_m.resize(5, 3);
  cloud.points_m << -0.05, 0, 0, -0.05, 0.0155, 0, -0.05, 0.0165, 0, 0.0055, 0, 0, 0.0065, 0, 0;
  const std::vector<Stick> sticks{{Vec3::Zero(), Vec3::UnitX(), 0.01}};
  const PointCloud left = without_sticks(cloud, sticks);
  ASSERT_EQ(left.points_m.rows(), 2) << "three are within 10 + 3 + 3 mm of the axis, and no 6 mm before the tip";
  EXPECT_EQ(left.points_m(0, 1), 0.0165);
  EXPECT_EQ(left.points_m(1, 0), 0.0065);
  EXPECT_EQ(without_sticks(cloud, {}).points_m, cloud.points_m);
}

// A camera 1 m above that looks down on a stick of 20 mm, whose upper end is 0.5 m from it.
TEST(Sticks, AreMaskedInImages) {
  DepthFrame frame;
  frame.camera = {64, 48, 100, 100, 31.5, 23.5, DistortionModel::none, {}};
  frame.noise.sigma_m = sigma_m;
  frame.T_base_camera.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  frame.T_base_camera.translation() = Vec3(0, 0, 1);
  frame.depth_m = DepthImage::Constant(48, 64, 1);
  frame.depth_m.block(20, 28, 8, 8).setConstant(0.5f);  // 20 mm to each side at 0.5 m
  frame.depth_m(0, 0) = 0;
  const std::vector<Stick> sticks{{Vec3(0, 0, 0.1), -Vec3::UnitZ(), 0.02}};
  const MaskImage mask = mask_sticks(frame, sticks);
  EXPECT_EQ(mask(24, 32), 1);
  EXPECT_EQ(mask(24, 28), 1) << "17.5 mm from the axis";
  EXPECT_EQ(mask(24, 27), 0) << "the table beside it";
  EXPECT_EQ(mask.cast<int>().block(20, 28, 8, 8).sum(), mask.cast<int>().sum());
  EXPECT_GE(mask.cast<int>().sum(), 60);
  EXPECT_EQ(mask_sticks(frame, {}).cast<int>().sum(), 0);
}

}  // namespace
}  // namespace palpate::sensing::stick_mask_test
