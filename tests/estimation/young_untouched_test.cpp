// label: unit
// SPDX-License-Identifier: Apache-2.0
// Recordings that say nothing of Young's modulus: nothing pressed, or a motion without its force.
#include <gtest/gtest.h>

#include <cmath>

#include "estimation/pressed_bar.hpp"
#include "estimation/pushed_block.hpp"
#include "palpate/estimation/growing_fit.hpp"

namespace palpate::estimation::young_untouched_test {
namespace {

FitOptions quick() {
  FitOptions options;
  options.cross_checks = options.stresses = false;
  return options;
}

/// Clouds of the block while nothing touches it.
Recording unloaded_block() {
  Recording recording = pushed_block_recording();
  for (Step& step : recording.pushes[0].steps) step.loads.clear();
  return recording;
}

Inputs unloaded_clouds() {
  PushedBlock truth;
  truth.finer = 1;
  truth.material = "linear";
  return clouds_of(truth, unloaded_block());
}

SimulatedObject block(const std::string& material) { return simulated(kuhn_block(4, 3, 2, block_size_m), material); }

/// What is said is the range that the search keeps to, and that it is no answer.
void expect_open(const Identification& answer, const std::string& about) {
  ASSERT_FALSE(answer.parameters.empty()) << about;
  const Parameter& young = parameter(answer, "young_modulus");
  EXPECT_FALSE(young.determined) << about;
  EXPECT_TRUE(says(answer, "e_not_determined")) << about;
  EXPECT_NEAR(young.lower_95, 1e-2, 1e-8) << about;
  EXPECT_NEAR(young.upper_95, 1.2e12, 1e6) << about;
  EXPECT_GT(young.value, young.lower_95) << about;
  EXPECT_LT(young.value, young.upper_95) << about;
  EXPECT_TRUE(std::isfinite(young.std)) << about;
  EXPECT_GT(young.std, young.value) << about;
  EXPECT_TRUE(answer.covariance.allFinite()) << about;
  EXPECT_GT(answer.covariance(0, 0), 1) << about;
  EXPECT_TRUE(answer.posterior.young_modulus_pa.allFinite() && answer.posterior.density.allFinite()) << about;
  for (const BudgetEntry& entry : answer.budget) EXPECT_TRUE(std::isfinite(entry.young_modulus_percent)) << about << ": " << entry.input;
}

TEST(YoungUntouched, NothingPressedSaysNothingOfIt) {
  for (const char* material : {"linear", "neo_hookean"}) {
    for (const bool known : {true, false}) {
      Recording recording = unloaded_block();
      recording.model.material = material;
      if (known) recording.model.poisson_fixed = 0.3;
      const std::string about = std::string(material) + (known ? ", nu known" : ", nu free");
      const Identification answer = fit(recording, block(material), unloaded_clouds(), quick());
      expect_open(answer, about);
      EXPECT_EQ(says(answer, "nu_not_determined"), !known) << about;
    }
  }
}

TEST(YoungUntouched, AMotionWithoutItsForceSaysNothingOfIt) {
  for (const char* material : {"linear", "neo_hookean"}) {
    Recording recording = pressed_bar(linear_force_n, 2e4, 0.3);
    recording.model.material = material;
    const SimulatedObject bar = simulated(kuhn_block(2, 2, 3, bar_m), material);
    Unknowns unknowns;
    ForwardModel model(recording, bar, unknowns);
    VectorX at = unknowns.prior_mean();
    at(log_young) = std::log(2e4);
    at(poisson) = 0.3;
    Inputs inputs;
    for (std::size_t s = 0; s < model.step_count(); ++s) {
      PointCloud cloud;
      cloud.points_m = model.predict(s, at, false).surface_m;
      cloud.sigma_m = VectorX::Constant(1, 1e-4);
      inputs.push_back({cloud});
    }
    const Identification answer = fit(recording, bar, inputs, {});  // with all that is asked once the fit is done
    expect_open(answer, material);
    EXPECT_NEAR(parameter(answer, "poisson_ratio").value, 0.3, 0.02) << material;  // which the shape does say
  }
}

TEST(YoungUntouched, ARegionsModulusIsAsOpen) {
  Recording recording = unloaded_block();
  recording.model.poisson_fixed = 0.3;
  SimulatedObject object = block("linear");
  put_two_halves(object);
  const Identification answer = fit(recording, object, unloaded_clouds(), quick());
  for (const Parameter& one : answer.parameters) {
    if (one.name != "young_modulus") continue;
    EXPECT_FALSE(one.determined) << one.region;
    EXPECT_GT(one.upper_95 / one.lower_95, 1e12) << one.region;
    EXPECT_LE(one.upper_95, 1.3e12) << one.region;
  }
}

/// A robot that looks before it presses.
TEST(YoungUntouched, RunningEstimatesGoThroughIt) {
  for (const bool known : {true, false}) {
    Recording recording = unloaded_block();
    recording.model.material = "linear";
    if (known) recording.model.poisson_fixed = 0.3;
    GrowingFit growing(quick());
    const Identification answer = growing.update(recording, block("linear"), unloaded_clouds());
    ASSERT_FALSE(answer.parameters.empty());
    EXPECT_FALSE(parameter(answer, "young_modulus").determined) << known;
    EXPECT_TRUE(says(answer, "e_not_determined")) << known;
    EXPECT_NEAR(parameter(answer, "young_modulus").upper_95, 1.2e12, 1e6) << known;
  }
}

}  // namespace
}  // namespace palpate::estimation::young_untouched_test
