// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/built_in.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/sensing/observe.hpp"
#include "refusals.hpp"

namespace palpate::lab::built_in_test {
namespace {

DemoOptions quick() {
  DemoOptions options;
  options.seed = 5;
  options.levels = 1;
  options.cells_in_radius = 1;
  options.sites_m = {0.0};
  options.threads = 1;
  return options;
}

const DepthFrame& depth_of(const Step& step) {
  for (const Observation& o : step.observations)
    if (const auto* frame = std::get_if<DepthFrame>(&o)) return *frame;
  throw Error("has no depth image", "step");
}

TEST(BuiltIn, RecordingIsWholeAndRepeatable) {
  const Demo demo = make_demo(quick()), again = make_demo(quick());
  const Recording& recording = demo.recording;
  ASSERT_EQ(recording.pushes.size(), 1u);
  ASSERT_EQ(recording.pushes[0].steps.size(), 2u);
  EXPECT_TRUE(recording.pushes[0].steps[0].loads.empty());
  for (std::size_t s = 0; s < 2; ++s) {
    const Step &step = recording.pushes[0].steps[s], &twin = again.recording.pushes[0].steps[s];
    EXPECT_EQ(depth_of(step).depth_m, depth_of(twin).depth_m);
    EXPECT_EQ(depth_of(step).mask, depth_of(twin).mask);
    if (s == 0) continue;
    EXPECT_EQ(*step.loads[0].force_n, *twin.loads[0].force_n);
    EXPECT_NEAR(step.loads[0].force_n->z(), -demo.truth.force_n[0][s], 0.05 * demo.truth.force_n[0][s] + 0.3);
  }
  DemoOptions other = quick();
  other.seed = 6;
  EXPECT_NE(make_demo(other).truth.young_modulus_pa, demo.truth.young_modulus_pa);
}

TEST(BuiltIn, ThreadsChangeNothing) {
  DemoOptions options = quick();
  options.sites_m = {-0.02, 0.03};
  const Demo one = make_demo(options);
  options.threads = 2;
  const Demo two = make_demo(options);
  for (std::size_t p = 0; p < 2; ++p) {
    EXPECT_EQ(one.truth.travel_m[p], two.truth.travel_m[p]);
    EXPECT_EQ(depth_of(one.recording.pushes[p].steps[1]).depth_m, depth_of(two.recording.pushes[p].steps[1]).depth_m);
  }
}

TEST(BuiltIn, UnloadedViewShowsTheStatedCubeWithinTheStatedNoise) {
  DemoOptions options = quick();
  options.camera_std_m = options.camera_std_rad = 0;
  const Recording recording = make_demo(options).recording;
  const geometry::TriangleTree cube(*recording.rest.surface);
  const RayCloud rays = sensing::observe(depth_of(recording.pushes[0].steps[0]), recording.environment);
  ASSERT_GT(rays.range_m.size(), 20000);
  double chi2 = 0;
  int near = 0, outliers = 0;
  for (Eigen::Index i = 0; i < rays.range_m.size(); ++i) {
    const auto hit = cube.cast(rays.origins_m.row(i), rays.directions.row(i));
    const double pull = hit ? (rays.range_m(i) - hit->range_m) / rays.sigma_m(i) : 99;
    if (std::abs(pull) > 5) {
      ++outliers;
      continue;
    }
    ++near;
    chi2 += pull * pull;
  }
  EXPECT_LT(outliers, 0.005 * double(rays.range_m.size()));
  // Lateral noise comes on top of the axial one that the rays' sigma states, most on the slanted sides.
  EXPECT_NEAR(std::sqrt(chi2 / near), 1.0, 0.25);
}

TEST(BuiltIn, BadOptionsAreRefusedAndCallersCanStop) {
  const auto refused = [](auto change) { return refuses([](const auto& o) { make_demo(o); }, quick(), change); };
  using O = DemoOptions;
  EXPECT_TRUE(refused([](O& o) { o.young_modulus_pa = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.poisson_ratio = 0.5; }));
  EXPECT_TRUE(refused([](O& o) { o.edge_m = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.disc_radius_m = 0.1; }));
  EXPECT_TRUE(refused([](O& o) { o.levels = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.depth_m = 0.1; }));
  EXPECT_TRUE(refused([](O& o) { o.sites_m.clear(); }));
  EXPECT_TRUE(refused([](O& o) { o.cells_in_radius = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.travel_sigma_m = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.material = "jelly"; }));
  EXPECT_TRUE(refused([](O& o) { o.depth_model = "eye"; }));
  EXPECT_THROW(make_demo(quick(), [](std::string_view, double) { return false; }), Error);
}

}  // namespace
}  // namespace palpate::lab::built_in_test
