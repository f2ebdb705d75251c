// label: unit
// SPDX-License-Identifier: Apache-2.0
// A fit that takes in one step after another ends where the fit of all steps at once does.
#include "palpate/estimation/growing_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pushed_block.hpp"

namespace palpate::estimation::growing_fit_test {
namespace {

Recording six_steps() {
  Recording recording = pushed_block_recording();
  recording.pushes[0].force_tare_std_n = 2e-3;
  auto& steps = recording.pushes[0].steps;
  const Step last = steps.back();
  steps.clear();
  for (int k = 1; k <= 6; ++k) {
    steps.push_back(last);
    steps.back().time_s = k;
    steps.back().loads[0].force_n = Vec3(0, 0, -0.02 * k);
    steps.back().loads[0].contact_std_m = 1e-3;
  }
  return recording;
}

/// The first `count` steps.
std::pair<Recording, Inputs> first_of(const Recording& recording, const Inputs& inputs, std::size_t count) {
  Recording part = recording;
  part.pushes[0].steps.resize(count);
  return {part, Inputs(inputs.begin(), inputs.begin() + static_cast<std::ptrdiff_t>(count))};
}

class OneAfterAnother : public testing::TestWithParam<const char*> {};

TEST_P(OneAfterAnother, EndsWhereTheFitOfAllStepsDoes) {
  const Recording recording = six_steps();
  PushedBlock truth;
  truth.material = GetParam();
  Inputs inputs = clouds_of(truth, recording);
  for (auto& step : inputs) {
    std::get<PointCloud>(step[0]).pose_std_m = 5e-4;
    std::get<PointCloud>(step[0]).pose_std_rad = 2e-3;
  }
  const SimulatedObject object = coarse_block(GetParam());
  FitOptions options;
  options.cross_checks = options.stresses = false;

  GrowingFit growing(options);
  Identification now;
  std::vector<double> spread;
  for (std::size_t count = 1; count <= inputs.size(); ++count) {
    const auto [part, seen] = first_of(recording, inputs, count);
    now = growing.update(part, object, seen);
    ASSERT_EQ(now.termination, Termination::converged) << "step " << count << ": " << now.message;
    EXPECT_EQ(now.fit.steps, count);
    spread.push_back(parameter(now, "young_modulus").std);
    const Parameter young = parameter(now, "young_modulus");
    EXPECT_LT(std::abs(young.value - truth.young_pa), 4 * young.std) << count;
  }
  EXPECT_LT(spread.back(), 0.5 * spread.front());

  const Identification batch = fit(recording, object, inputs, options);
  ASSERT_EQ(batch.termination, Termination::converged) << batch.message;
  for (const char* name : {"young_modulus", "poisson_ratio"}) {
    const Parameter one = parameter(now, name), all = parameter(batch, name);
    EXPECT_NEAR(one.value, all.value, 0.1 * all.std) << name;
    EXPECT_NEAR(one.std, all.std, 0.1 * all.std) << name;
    EXPECT_NEAR(one.lower_95, all.lower_95, 0.15 * all.std) << name;
    EXPECT_NEAR(one.upper_95, all.upper_95, 0.15 * all.std) << name;
  }
  ASSERT_EQ(now.nuisances.size(), batch.nuisances.size());
  for (std::size_t k = 0; k < batch.nuisances.size(); ++k) {
    EXPECT_EQ(now.nuisances[k].name, batch.nuisances[k].name);
    EXPECT_NEAR(now.nuisances[k].value, batch.nuisances[k].value, 0.1 * batch.nuisances[k].prior_std) << batch.nuisances[k].name;
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, OneAfterAnother, testing::Values("linear", "neo_hookean"));

TEST(GrowingFit, EvaluatesOldStepsOnlyWhereTheUnknownsHaveMoved) {
  Recording recording = six_steps();
  recording.model.poisson_fixed = 0.3;  // no search over nu
  PushedBlock truth;
  truth.points = 1000;
  const Inputs inputs = clouds_of(truth, recording);
  const SimulatedObject object = coarse_block();
  FitOptions options;
  options.cross_checks = options.stresses = false;
  options.poisson_start = 0.3;
  GrowingFit growing(options);
  for (std::size_t count = 1; count <= 5; ++count) {
    const auto [part, seen] = first_of(recording, inputs, count);
    growing.update(part, object, seen);
  }
  growing.update(recording, object, inputs);
  const int kept = growing.steps_evaluated();

  GrowingFit at_once(options);
  at_once.update(recording, object, inputs);
  EXPECT_LT(kept, at_once.steps_evaluated() / 2);
}

TEST(GrowingFit, FindsItsWayBackFromAFarStart) {
  // The first steps say something else altogether: forces that were read ten times too small.
  Recording recording = six_steps();
  const PushedBlock truth;
  const Inputs inputs = clouds_of(truth, recording);
  FitOptions options;
  options.cross_checks = options.stresses = false;
  GrowingFit growing(options);
  auto [part, seen] = first_of(recording, inputs, 2);
  for (Step& step : part.pushes[0].steps) step.loads[0].force_n = 0.1 * *step.loads[0].force_n;
  growing.update(part, coarse_block(), seen);
  growing.forget_object();
  const Identification now = growing.update(recording, coarse_block(), inputs);
  const Parameter young = parameter(now, "young_modulus");
  EXPECT_LT(std::abs(young.value - truth.young_pa), 4 * young.std);
}

}  // namespace
}  // namespace palpate::estimation::growing_fit_test
