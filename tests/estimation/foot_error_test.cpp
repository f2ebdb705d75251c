// label: unit
// SPDX-License-Identifier: Apache-2.0
// A block held at one end, of which a strip above that end was not seen: what a wider or a moved end does to E is what a fit with such
// an end says, and it is in the interval.
#include "palpate/estimation/foot_error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "palpate/estimation/shape_error.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::foot_error_test {
namespace {

FootDoubt doubt_of_end() { return {Plane{Vec3::Zero(), Vec3::UnitX()}, 0.01, {}}; }

TEST(FootError, NodesOfTheStripGoOutwardsOrAside) {
  const SimulatedObject block = simulated(fem::to_quadratic(kuhn_block(8, 3, 2, block_size_m)), "linear");
  const Points& before = block.mesh.nodes_m;
  const FootDoubt doubt = doubt_of_end();
  const double radius_m = std::sqrt(block_size_m.y() * block_size_m.z() / M_PI);
  const Points wider = with_foot_moved(block.mesh, block.surface.rest(), doubt, 0.1, Vec3::Zero()).nodes_m;
  const Points aside = with_foot_moved(block.mesh, block.surface.rest(), doubt, 0, 0.1 * Vec3::UnitY()).nodes_m;
  for (Index i = 0; i < before.rows(); ++i) {
    const double depth_m = std::max(0.0, doubt.strip_m - before(i, 0));
    const Vec3 from_middle(0, before(i, 1) - 0.5 * block_size_m.y(), before(i, 2) - 0.5 * block_size_m.z());
    EXPECT_LT((Vec3(wider.row(i) - before.row(i)) - 0.1 * depth_m / radius_m * from_middle).norm(), 1e-12);
    EXPECT_LT((Vec3(aside.row(i) - before.row(i)) - 0.1 * depth_m * Vec3::UnitY()).norm(), 1e-12);
  }
}

TEST(FootError, SaysWhatAFitWithAnotherFootSays) {
  Recording recording = pushed_block_recording();
  recording.model.poisson_fixed = 0.3;
  PushedBlock truth;
  truth.material = "linear";
  truth.points = 4000;
  truth.sigma_m = 2e-4;
  const Inputs inputs = clouds_of(truth, recording);
  SimulatedObject block = simulated(fem::to_quadratic(kuhn_block(8, 3, 2, block_size_m)), "linear");
  FitOptions options;
  options.cross_checks = options.stresses = false;
  const Identification without = fit(recording, block, inputs, options);
  ShapeDoubt doubt;
  doubt.foot = doubt_of_end();
  const Identification with = fit(recording, block, inputs, options, {}, nullptr, nullptr, &doubt);
  ASSERT_TRUE(doubt.foot->effect);
  ASSERT_EQ(doubt.foot->effect->size(), 3U);
  block.mesh = with_foot_moved(block.mesh, block.surface.rest(), *doubt.foot, foot_lean_std_rad, Vec3::Zero());
  const Identification other = fit(recording, block, inputs, options);

  const double expected = std::log(parameter(other, "young_modulus").value / parameter(without, "young_modulus").value);
  EXPECT_LT(expected, -0.005);  // it is held better: less E will do
  EXPECT_NEAR((*doubt.foot->effect)[0].log_young, expected, 0.2 * std::abs(expected));
  EXPECT_EQ(parameter(with, "young_modulus").value, parameter(without, "young_modulus").value);
  EXPECT_GT(parameter(with, "young_modulus").std, 1.05 * parameter(without, "young_modulus").std);
  const auto named = [](const Identification& answer, const char* name) {
    return std::any_of(answer.budget.begin(), answer.budget.end(), [&](const BudgetEntry& entry) { return entry.input == name; });
  };
  EXPECT_TRUE(named(with, "foot"));
  EXPECT_FALSE(named(without, "foot"));
  for (const auto& verdict : with.verdicts) EXPECT_NE(verdict.code, "partly_seen");
}

}  // namespace
}  // namespace palpate::estimation::foot_error_test
