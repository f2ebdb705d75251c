// label: unit
// SPDX-License-Identifier: Apache-2.0
// Loads under which a patch of even pressure caves in are not fitted, and that is said.
#include "palpate/estimation/deep_loads.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pushed_block.hpp"

namespace palpate::estimation::deep_loads_test {
namespace {

constexpr double young_pa = 2e4;
constexpr double pad_m2 = std::numbers::pi * 0.012 * 0.012;

/// Pressed from above with these mean pressures over E.
Recording pressed_with(const std::vector<double>& over_young) {
  std::vector<Vec3> forces_n;
  for (const double share : over_young) forces_n.emplace_back(0, 0, -share * young_pa * pad_m2);
  return glued_block_recording(forces_n, 0.03, 0.02);
}

Identification found(double pa) {
  Identification answer;
  answer.termination = Termination::converged;
  answer.parameters = {{"young_modulus", "", "Pa", pa}};
  return answer;
}

TEST(DeepLoads, APushEndsBeforeItsFirstOne) {
  Recording recording = pressed_with({0, 0.1, 0.3, 0.5, 0.2});
  recording.pushes.push_back(recording.pushes[0]);
  recording.pushes[1].steps.resize(3);
  EXPECT_EQ(steps_within_pressure(recording, young_pa), (StepCounts{3, 3}));
  EXPECT_EQ(steps_within_pressure(recording, 2 * young_pa), (StepCounts{5, 3}));
  EXPECT_EQ(steps_within_pressure(recording, 0.5 * young_pa), (StepCounts{2, 2}));
  const std::vector<int> flat{0, 1, 2, 3, 4, 10, 11, 12};
  EXPECT_EQ(first_steps(flat, recording, {3, 2}), (std::vector<int>{0, 1, 2, 10, 11}));
  keep_first_steps(recording, {3, 2});
  EXPECT_EQ(all_steps(recording), (StepCounts{3, 2}));
}

TEST(DeepLoads, AToolOfOtherShapeHasNoMeanPressure) {
  Recording recording = pressed_with({0.1, 0.9});
  recording.tools[0].shape = ToolShape::platen;
  EXPECT_EQ(steps_within_pressure(recording, young_pa), all_steps(recording));
}

/// Which steps were fitted, one list a fit.
struct Asked {
  std::vector<StepCounts> fits;
  StepCounts fitted;
  Identification answer;
};

Asked asked(const Recording& recording, double start_pa, const std::string& material = "neo_hookean") {
  Asked out;
  FitOptions options;
  options.young_start_pa = start_pa;
  const Inputs none(recording.pushes[0].steps.size());
  out.answer = fit_within_pressure(recording, coarse_block(material), none, options, [&](const StepCounts& steps) {
    out.fits.push_back(steps);
    return found(young_pa);
  }, &out.fitted);
  return out;
}

TEST(DeepLoads, WhatTheFitSaysOfEDecides) {
  const Recording recording = pressed_with({0.1, 0.2, 0.3, 0.5, 0.9});
  const Asked soft = asked(recording, 0.3 * young_pa);
  EXPECT_EQ(soft.fits, (std::vector<StepCounts>{{1}, {3}}));
  EXPECT_EQ(soft.fitted, StepCounts{3});
  const Asked stiff = asked(recording, 10 * young_pa);
  EXPECT_EQ(stiff.fits, (std::vector<StepCounts>{{5}, {3}}));
  ASSERT_EQ(stiff.answer.verdicts.size(), 1u);
  EXPECT_EQ(stiff.answer.verdicts[0].code, "deep_loads_left_out");
  EXPECT_NE(stiff.answer.verdicts[0].message.find("From step 3 of push 'down' on"), std::string::npos) << stiff.answer.verdicts[0].message;
  EXPECT_NE(stiff.answer.verdicts[0].message.find("up to 0.9 E"), std::string::npos) << stiff.answer.verdicts[0].message;
}

// Seed 52 of `palpate paper`'s cubes pressed 9 cm deep lost it with the deep loads, and E came out 22 % too high.
TEST(DeepLoads, ASlipThatTheyToldIsKept) {
  const Recording recording = pressed_with({0.1, 0.2, 0.3, 0.5, 0.9});
  const Inputs none(recording.pushes[0].steps.size());
  FitOptions options;
  options.young_start_pa = 10 * young_pa;
  for (const std::size_t step : {1, 2, 3}) {
    const Identification answer = fit_within_pressure(recording, coarse_block("neo_hookean"), none, options, [&](const StepCounts& steps) {
      Identification of_these = found(young_pa);
      if (steps == StepCounts{5}) of_these.slip = Slip{0, step, 0.004, 0.002, 30, 1e-6};
      return of_these;
    });
    ASSERT_EQ(answer.slip.has_value(), step < 3) << "a slip at the first load that is left out is none of the rest";
    if (answer.slip) {
      EXPECT_EQ(answer.slip->step, step);
    }
  }
}

TEST(DeepLoads, NothingIsLeftOutOfLightLoadsOrALinearBodyOrWhereNothingWouldBeLeft) {
  for (const auto& [over_young, material] : std::vector<std::pair<std::vector<double>, std::string>>{
           {{0.1, 0.2, 0.3}, "neo_hookean"}, {{0.1, 0.5, 0.9}, "linear"}, {{0.7, 0.9}, "neo_hookean"}}) {
    const Recording recording = pressed_with(over_young);
    const Asked once = asked(recording, young_pa, material);
    EXPECT_EQ(once.fits, std::vector<StepCounts>{all_steps(recording)}) << material;
    EXPECT_TRUE(once.answer.verdicts.empty()) << material;
  }
}

// The deep steps state forces that a real tool would take there; their clouds are those of a dent that is no deeper, as if the
// block had not caved in. Linear theory has to find from the lighter loads that they are beyond.
TEST(DeepLoads, AreNoPartOfTheAnswer) {
  const Recording recording = pressed_with({0.05, 0.1, 0.15, 0.2, 0.7, 1.1});
  Recording bearable = recording;
  keep_first_steps(bearable, {4});
  PushedBlock truth;
  truth.young_pa = young_pa;
  truth.points = 800;
  truth.sigma_m = 2e-4;
  const Inputs seen = clouds_of(truth, bearable);
  Inputs inputs = seen;
  inputs.resize(6, seen.back());
  FitOptions options;
  options.cross_checks = options.stresses = false;
  const SimulatedObject object = coarse_block();
  StepCounts fitted;
  const Identification answer = fit_within_pressure(recording, object, inputs, options, [&](const StepCounts& steps) {
    Recording some = recording;
    keep_first_steps(some, steps);
    return fit(some, object, first_steps(inputs, recording, steps), options);
  }, &fitted);
  EXPECT_EQ(fitted, StepCounts{4});
  EXPECT_TRUE(says(answer, "deep_loads_left_out"));
  const Identification alone = fit(bearable, object, seen, options);
  EXPECT_EQ(parameter(answer, "young_modulus").value, parameter(alone, "young_modulus").value);
  EXPECT_NEAR(std::log(parameter(answer, "young_modulus").value / young_pa), 0, 0.1);  // the block's mesh is coarse
  // All of them together are far off.
  const Identification all = fit(recording, object, inputs, options);
  EXPECT_GT(std::abs(std::log(parameter(all, "young_modulus").value / young_pa)), 0.3);
}

// A load that is beyond makes the object look so stiff that it seems to be within; the lighter ones tell. (Seed 79 of the cubes
// pressed 9 cm deep: E 42 % too high with one load of 0.49 E.)
TEST(DeepLoads, OneThatSpoiltTheEByWhichItCountsIsLeftOut) {
  PushedBlock truth;
  truth.young_pa = young_pa;
  truth.points = 800;
  truth.sigma_m = 2e-4;
  FitOptions options;
  options.cross_checks = options.stresses = false;
  options.young_start_pa = 1.3 * young_pa;
  const SimulatedObject object = coarse_block();
  for (const double deepest : {0.45, 0.32}) {
    const bool beyond = deepest > largest_pressure;
    const Recording recording = pressed_with({0, 0.15, 0.2, 0.25, deepest});
    const Recording dents = pressed_with({0, 0.15, 0.2, 0.25, beyond ? 0.2 : deepest});
    const Inputs inputs = clouds_of(truth, dents);
    StepCounts fitted;
    std::vector<StepCounts> fits;
    const Identification answer = fit_within_pressure(recording, object, inputs, options, [&](const StepCounts& steps) {
      fits.push_back(steps);
      Recording some = recording;
      keep_first_steps(some, steps);
      return fit(some, object, first_steps(inputs, recording, steps), options);
    }, &fitted);
    ASSERT_EQ(fits.front(), StepCounts{5}) << "by the E of all, the deepest is within";
    EXPECT_EQ(fitted, StepCounts{beyond ? 4u : 5u});
    EXPECT_EQ(fits.size(), beyond ? 2u : 1u) << "a load that belongs there costs no fit but the one of the lighter loads";
    EXPECT_EQ(says(answer, "deep_loads_left_out"), beyond);
    EXPECT_NEAR(std::log(parameter(answer, "young_modulus").value / young_pa), 0, 0.1);
    if (!beyond) continue;
    const Identification all = fit(recording, object, inputs, options);
    EXPECT_GT(parameter(all, "young_modulus").value, deepest / largest_pressure * young_pa);
  }
}

}  // namespace
}  // namespace palpate::estimation::deep_loads_test
