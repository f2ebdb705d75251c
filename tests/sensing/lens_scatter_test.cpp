// label: unit
// SPDX-License-Identifier: Apache-2.0
// What the picture says of the light that the lens spreads, against a sensor that spreads it by adding phasors.
#include "palpate/sensing/lens_scatter.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/lab/depth_sensor.hpp"
#include "sensing/small_camera.hpp"

namespace palpate::sensing::lens_scatter_test {
namespace {

double stretch_at(int row, int column) {
  return std::sqrt(1 + std::pow((column - 79.5) / 300, 2) + std::pow((row - 59.5) / 300, 2));
}

/// A wall at 1.6 m, and a quarter of the picture nearer; all of it faces the camera.
lab::PerfectView scene() {
  lab::PerfectView view;
  view.depth_m = DepthImage::Constant(120, 160, 1.6F);
  view.depth_m.block(30, 40, 60, 80).setConstant(0.9F);
  view.label = MaskImage::Ones(120, 160);
  view.incidence_rad.resize(120, 160);
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 160; ++column) view.incidence_rad(row, column) = float(std::acos(1 / stretch_at(row, column)));
  return view;
}

DepthFrame seen(double share, std::uint64_t seed = 4) {
  lab::DepthSensorOptions sensor = lab::depth_sensor("time_of_flight");
  sensor.lens_scatter = share;
  sensor.flying_pixel_share = 0;
  lab::Random random(seed);
  DepthFrame frame;
  frame.camera = small_camera();
  frame.noise = lab::stated_noise(sensor);
  frame.depth_m = lab::sense_depth(scene(), frame.camera, sensor, random);
  return frame;
}

TEST(LensScatter, TellsHowFarEveryRangeMoves) {
  const double share = 0.01;
  const DepthImage moved = seen(share).depth_m - seen(0).depth_m;  // the same noise in both
  const DepthFrame frame = seen(share);
  const auto scatter = lens_scatter(frame);
  ASSERT_TRUE(scatter);
  EXPECT_EQ(scatter->share_std, 0.02);
  for (const auto& [row, column, z] : {std::tuple{60, 80, 0.9}, {40, 50, 0.9}, {85, 115, 0.9}, {10, 20, 1.6}, {110, 150, 1.6}}) {
    const double stretch = stretch_at(row, column);
    const double predicted_m = share * scatter->error(z * stretch, 1 / stretch).m / stretch;
    EXPECT_GT(std::abs(predicted_m), 5e-4);
    // Depth alone says how bright a pixel is; normals out of noisy depths tilt, which takes a few per cent of the light.
    EXPECT_NEAR(moved(row, column) / predicted_m, 1, 0.15) << row << " " << column;
  }
}

TEST(LensScatter, HasTheDerivativesThatItStates) {
  const LensScatter scatter{0.02, std::polar(0.7, LensScatter::phase_per_m * 1.4)};
  const double r = 0.8, c = 0.6, h = 1e-5;
  const auto at = scatter.error(r, c);
  EXPECT_NEAR(at.per_range, (scatter.error(r + h, c).m - scatter.error(r - h, c).m) / (2 * h), 1e-7);
  EXPECT_NEAR(at.per_cosine, (scatter.error(r, c + h).m - scatter.error(r, c - h).m) / (2 * h), 1e-7);
}

TEST(LensScatter, IsThereWhereTheNoiseKnowsOfIt) {
  DepthFrame frame = seen(0);
  EXPECT_TRUE(lens_scatter(frame));
  frame.noise.lens_scatter_std = 0;
  EXPECT_FALSE(lens_scatter(frame)) << "said to have none";
  frame.noise = {"constant", 0.005};
  EXPECT_FALSE(lens_scatter(frame));
  frame.noise.lens_scatter_std = 0.01;
  ASSERT_TRUE(lens_scatter(frame));
  EXPECT_EQ(lens_scatter(frame)->share_std, 0.01);
}

}  // namespace
}  // namespace palpate::sensing::lens_scatter_test
