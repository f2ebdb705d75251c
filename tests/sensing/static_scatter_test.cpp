// label: statistics
// SPDX-License-Identifier: Apache-2.0
// What unloaded repeats say of a sensor's noise, where the noise is known: whatever is stated, and whatever comes into the picture.
#include "palpate/sensing/static_scatter.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "still_life.hpp"

namespace palpate::sensing::static_scatter_test {
namespace {

const StaticScatter& of(const std::vector<StaticScatter>& all, const std::string& what) {
  for (const auto& one : all)
    if (one.what == what) return one;
  throw std::runtime_error("nothing is said of " + what);
}

TEST(StaticScatter, IsTheNoiseThatWasPutIn) {
  const auto all = static_scatter(still_life({}));
  const StaticScatter &depth = of(all, "depth"), &force = of(all, "wrench force");
  EXPECT_EQ(depth.repeats, 8u);  // both pushes were seen from one place
  EXPECT_EQ(force.repeats, 8u);
  EXPECT_EQ(force.differences, 2u * 3u * 3u);
  // Along the ray, which is up to 1.14 times as long as the depth.
  EXPECT_NEAR(depth.measured, 2e-3, 0.1 * 2e-3);
  EXPECT_NEAR(depth.ratio, 1, 0.03);
  EXPECT_NEAR(force.measured, 0.05, 3 * 0.05 / std::sqrt(2.0 * 18));
  EXPECT_FALSE(depth.doubtful());
  EXPECT_FALSE(force.doubtful());
}

TEST(StaticScatter, AWrongStatementIsDoubted) {
  StillLife truth;
  truth.stated_depth_m = 1e-3;
  truth.stated_force_n = 0.2;
  const auto all = static_scatter(still_life(truth));
  EXPECT_NEAR(of(all, "depth").measured, 2e-3, 0.1 * 2e-3);
  EXPECT_NEAR(of(all, "depth").ratio, 2, 0.1);
  EXPECT_TRUE(of(all, "depth").doubtful());
  EXPECT_NEAR(of(all, "wrench force").ratio, 0.25, 0.1);
  EXPECT_TRUE(of(all, "wrench force").doubtful());
}

TEST(StaticScatter, RoundedDepthsAndWhatCameIntoThePictureChangeLittle) {
  StillLife truth;
  truth.step_m = 1e-3;
  EXPECT_NEAR(of(static_scatter(still_life(truth)), "depth").measured, std::hypot(2e-3, 1e-3 / std::sqrt(12.0)), 0.1 * 2e-3);
  truth.step_m = 0;
  truth.intruder = 0.2;
  EXPECT_NEAR(of(static_scatter(still_life(truth)), "depth").measured, 2e-3, 0.15 * 2e-3);
}

TEST(StaticScatter, OfASingleAxisOnlyThatAxisCounts) {
  StillLife truth;
  truth.along_z_only = true;
  const StaticScatter force = of(static_scatter(still_life(truth)), "wrench force");
  EXPECT_EQ(force.differences, 6u);
  EXPECT_NEAR(force.measured, 0.05, 3 * 0.05 / std::sqrt(2.0 * 6));
}

TEST(StaticScatter, OfOneFrameNothingIsSaid) {
  StillLife truth;
  truth.frames = 1;
  Recording recording = still_life(truth);
  recording.pushes.pop_back();
  EXPECT_TRUE(static_scatter(recording).empty());
}

}  // namespace
}  // namespace palpate::sensing::static_scatter_test
