// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/plane_mask.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "palpate/core/error.hpp"
#include "palpate/sensing/masked_points.hpp"

namespace palpate::sensing::plane_mask_test {
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
  // The corners of what is hardly higher than the margin have more table than object around them.
  EXPECT_EQ(mask.cast<int>().sum(), 30 * 40 - 100 - 1 + 4 * 3);
}

TEST(MaskedPoints, AreWhereTheCameraSawThemThinnedAndNearTheObjectOnly) {
  DepthFrame frame = from_above(0.8F);
  frame.mask = MaskImage::Zero(30, 40);
  EXPECT_EQ(masked_points(frame, Vec3::Constant(-1e3), Vec3::Constant(1e3), 100).rows(), 0);
  frame.mask.block(0, 0, 30, 20).setConstant(1);
  frame.depth_m(3, 3) = 0;  // masked, but nothing was seen there
  const Points all = masked_points(frame, Vec3::Constant(-1e3), Vec3::Constant(1e3), 1000);
  ASSERT_EQ(all.rows(), 30 * 20 - 1);
  // Straight above a table at height 0: pixel (0, 0) sees 19.5 pixels to the side and 14.5 up.
  EXPECT_NEAR((all.row(0).transpose() - Vec3(0.3 - 19.5 / 60 * 0.8, 0.1 + 14.5 / 60 * 0.8, 0)).norm(), 0, 1e-6);
  EXPECT_EQ(masked_points(frame, Vec3::Constant(-1e3), Vec3::Constant(1e3), 50).rows(), 50);
  const Points near = masked_points(frame, Vec3(0.2, 0, -0.1), Vec3(0.4, 0.2, 0.1), 1000);
  EXPECT_GT(near.rows(), 0);
  EXPECT_LT(near.rows(), all.rows());
  EXPECT_GE(near.col(0).minCoeff(), 0.2);
}

// A steep plane that stands on the table, seen with noise: what the mask leaves of it must not be what noise pulled forward.
TEST(PlaneMask, LeavesNoBiasAboveTheTable) {
  DepthFrame frame = from_above(0.8F);
  frame.camera.width_px = 320;
  frame.camera.height_px = 240;
  frame.camera.fx_px = frame.camera.fy_px = 600;
  frame.camera.cx_px = 159.5;
  frame.camera.cy_px = 119.5;
  frame.noise = {"constant", 0.003, 0};
  const double sigma = 0.003, slope = 2.0;  // height gained per metre across the image
  const auto mean_error = [&](int window_px) {
    std::mt19937 engine(7);
    std::normal_distribution<double> noise(0, sigma);
    double sum = 0;
    int count = 0;
    for (int draw = 0; draw < 16; ++draw) {
      frame.depth_m.resize(240, 320);
      DepthImage error(240, 320);
      for (int row = 0; row < 240; ++row)
        for (int column = 0; column < 320; ++column) {
          const double across_m = (column - 100.0) / 600 * 0.8;
          const double height_m = std::max(0.0, slope * across_m);
          error(row, column) = float(noise(engine));
          frame.depth_m(row, column) = float(0.8 - height_m) + error(row, column);
        }
      const MaskImage mask = mask_planes(frame, {Plane{}}, {0.003, 3.0, window_px});
      // The strip about the margin, 3 mm + 3 sigma high.
      for (int row = 0; row < 240; ++row)
        for (int column = 100; column < 110; ++column)
          if (!mask(row, column)) {
            sum += error(row, column);
            ++count;
          }
    }
    EXPECT_GT(count, 1000);
    return sum / count;
  };
  EXPECT_LT(mean_error(0), -0.2 * sigma) << "deciding by the pixel's own depth is what this guards against";
  EXPECT_NEAR(mean_error(2), 0, 0.01 * sigma) << "the pixel itself in the median leaves a fiftieth";
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
  EXPECT_THROW(mask_planes(frame, {}, {0.003, 3, -1}), Error);
  EXPECT_EQ(mask_planes(frame, {}).cast<int>().sum(), 0);
}

}  // namespace
}  // namespace palpate::sensing::plane_mask_test
