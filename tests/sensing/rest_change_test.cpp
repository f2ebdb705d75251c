// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/rest_change.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "palpate/core/error.hpp"

namespace palpate::sensing::rest_change_test {
namespace {

/// A block of 60 x 60 pixels, 0.1 m before a wall; pixels beside its edges report anything between.
DepthFrame scene(int left, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> share(0, 1);
  DepthFrame frame;
  frame.camera.width_px = 160;
  frame.camera.height_px = 120;
  frame.camera.fx_px = frame.camera.fy_px = 300;
  frame.noise.sigma_m = 0.002;
  frame.depth_m.resize(120, 160);
  for (int r = 0; r < 120; ++r)
    for (int c = 0; c < 160; ++c) {
      const int in = std::min({r - 30, 90 - r, c - left, left + 60 - c});
      const double depth = in > 1 ? 0.7 : in < -1 ? 0.8 : 0.7 + 0.1 * share(random);
      frame.depth_m(r, c) = float(depth + 0.002 * normal(random));
    }
  return frame;
}

TEST(ChangedShare, IsNothingWhereOnlyNoiseIsNew) {
  for (unsigned seed = 1; seed < 20; seed += 2) EXPECT_EQ(changed_share(scene(50, seed), scene(50, seed + 1)), 0);
}

TEST(ChangedShare, IsTheStripThatAMovedBlockLeavesAndTakes) {
  // Moved by 10 pixels: two strips of about 10 x 61 of 19200 pixels, less a rim of two.
  EXPECT_NEAR(changed_share(scene(50, 1), scene(60, 2)), 2 * 6 * 57 / 19200.0, 0.012);
  EXPECT_GT(changed_share(scene(50, 1), scene(60, 2)), 0.02);
}

TEST(ChangedShare, LooksAtNothingThatIsMaskedOrMissing) {
  DepthFrame before = scene(50, 1), after = scene(60, 2);
  after.mask = MaskImage::Zero(120, 160);
  after.mask.middleCols(40, 90).setOnes();
  EXPECT_EQ(changed_share(before, after), 0);
  before.depth_m.setZero();
  EXPECT_EQ(changed_share(before, after), 0);
  before.depth_m.resize(3, 3);
  EXPECT_THROW(changed_share(before, after), Error);
}

}  // namespace
}  // namespace palpate::sensing::rest_change_test
