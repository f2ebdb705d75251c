// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/plane_mask.hpp"

#include <gtest/gtest.h>

#include "palpate/core/error.hpp"

namespace palpate::sensing {
namespace {

// Camera 0.8 m above the table, looking straight down.
DepthFrame from_above(float depth_m) {
  DepthFrame frame;
  frame.camera.width_px = 40;
  frame.camera.height_px = 30;
  frame.camera.fx_px = frame.camera.fy_px = 60;
  frame.camera.cx_px = 19.5;
  frame.camera.cy_px = 14.5;
  frame.depth_m = DepthImage::Constant(30, 40, depth_m);
  frame.noise = {"constant", 0.002, 0};
  frame.T_base_camera.translate(Vec3(0.3, 0.1, 0.8)).rotate(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  return frame;
}

TEST(PlaneMask, TableGoesAndWhatStandsOnItStays) {
  DepthFrame frame = from_above(0.8F);
  frame.depth_m.block(5, 5, 10, 10).setConstant(0.79F);   // 10 mm high: above 3 mm + 3 sigma = 9 mm
  frame.depth_m.block(20, 5, 5, 10).setConstant(0.793F);  // 7 mm high: not told from the table
  frame.depth_m(0, 0) = 0;
  frame.depth_m(0, 1) = 1.2F;  // under the table: cannot be
  const MaskImage mask = mask_planes(frame, {Plane{}});
  EXPECT_EQ(mask(10, 10), 0);
  EXPECT_EQ(mask(22, 8), 1);
  EXPECT_EQ(mask(2, 30), 1);
  EXPECT_EQ(mask(0, 0), 0);
  EXPECT_EQ(mask(0, 1), 1);
  EXPECT_EQ(mask.cast<int>().sum(), 30 * 40 - 100 - 1);
}

TEST(PlaneMask, MergesAndRefuses) {
  DepthFrame frame = from_above(0.8F);
  MaskImage own = MaskImage::Zero(30, 40);
  own(3, 3) = 1;
  MaskImage other = MaskImage::Zero(30, 40);
  other(4, 4) = 1;
  frame = with_mask(with_mask(frame, own), other);
  EXPECT_EQ(frame.mask.cast<int>().sum(), 2);
  EXPECT_THROW(with_mask(frame, MaskImage::Zero(2, 2)), Error);
  EXPECT_THROW(mask_planes(frame, {Plane{Vec3::Zero(), -Vec3::UnitZ()}}), Error);
  EXPECT_THROW(mask_planes(frame, {}, {-1, 3}), Error);
  EXPECT_THROW(mask_planes(frame, {}, {0, -3}), Error);
  EXPECT_EQ(mask_planes(frame, {}).cast<int>().sum(), 0);
}

}  // namespace
}  // namespace palpate::sensing
