// label: unit
// SPDX-License-Identifier: Apache-2.0
// A block whose halves differ in stiffness: what each half is, how often its interval holds it, and that one stiffness for
// both is not believed.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "palpate/estimation/fit.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::region_fit_test {
namespace {

Identification fit_halves(const PushedBlock& truth, bool regions = true) {
  SimulatedObject object = coarse_block();
  if (regions) put_two_halves(object);
  const Recording recording = pushed_block_recording();
  return fit(recording, object, clouds_of(truth), {});
}

bool holds(const Parameter& parameter, double truth) { return parameter.lower_95 <= truth && truth <= parameter.upper_95; }

TEST(RegionFit, IntervalsHoldTheModuliOfBothHalves) {
  constexpr int seeds = 12;
  int clamped = 0, free = 0, nu = 0;
  double squares = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    PushedBlock truth;
    truth.seed = static_cast<unsigned>(seed);
    truth.young_pa = 2e4 * (1 + 0.02 * seed);
    truth.free_half = std::exp(0.15 * (seed - 6.5));
    truth.poisson = 0.15 + 0.02 * seed;
    const Identification answer = fit_halves(truth);
    ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
    ASSERT_EQ(answer.parameters.size(), 3u);
    EXPECT_EQ(answer.parameters[0].region, "clamped half");
    EXPECT_EQ(answer.parameters[1].name, "poisson_ratio");
    EXPECT_EQ(answer.parameters[2].region, "free half");
    clamped += holds(answer.parameters[0], truth.young_pa);
    nu += holds(answer.parameters[1], truth.poisson);
    free += holds(answer.parameters[2], truth.free_half * truth.young_pa);
    const auto pull = [](const Parameter& p, double at) { return std::log(p.value / at) * p.value / p.std; };
    squares += std::pow(pull(answer.parameters[0], truth.young_pa), 2) +
               std::pow(pull(answer.parameters[2], truth.free_half * truth.young_pa), 2);
    EXPECT_FALSE(says(answer, "not_homogeneous"));
  }
  // At least 0.95 of twelve less three binomial standard deviations.
  EXPECT_GE(clamped, 9);
  EXPECT_GE(free, 9);
  EXPECT_GE(nu, 9);
  // Errors are as large as they are said to be: chi-square of 24 pulls within three standard deviations.
  EXPECT_NEAR(squares / (2 * seeds), 1, 3 * std::sqrt(2.0 / (2 * seeds)));
}

TEST(RegionFit, CovarianceIsThatOfTheParameters) {
  PushedBlock truth;
  truth.free_half = 2;
  const Identification answer = fit_halves(truth);
  ASSERT_EQ(answer.covariance.rows(), 3);
  EXPECT_LT((answer.covariance - answer.covariance.transpose()).norm(), 1e-12);
  for (const int k : {0, 2}) {
    const Parameter& young = answer.parameters[static_cast<std::size_t>(k)];
    EXPECT_NEAR(std::sqrt(answer.covariance(k, k)), young.std / young.value, 0.02 * young.std / young.value);
  }
  EXPECT_NEAR(std::sqrt(answer.covariance(1, 1)), answer.parameters[1].std, 0.02 * answer.parameters[1].std);
  // One force bends both halves: where one is stiffer the other is softer.
  EXPECT_LT(answer.covariance(0, 2), 0);
  const double determinant = answer.covariance.determinant();
  EXPECT_GT(determinant, 0);
}

// The free half is pressed; what the other one is made of says nothing of how deep that is.
TEST(RegionFit, APressureIsJudgedByTheRegionThatIsPressed) {
  const auto is_beyond = [](double young_pa, double free_half) {
    Recording sharp = pushed_block_recording();
    sharp.tools[0].radius_m = 0.0025;
    SimulatedObject object = coarse_block();
    put_two_halves(object);
    PushedBlock truth;
    truth.young_pa = young_pa, truth.free_half = free_half;
    return says(fit(sharp, object, clouds_of(truth, sharp), {}), "pressure_beyond_model");
  };
  EXPECT_TRUE(is_beyond(2e4, 0.6)) << "half of E there, 0.3 of the other";
  EXPECT_FALSE(is_beyond(1.2e4, 4)) << "an eighth, half of the other";
}

TEST(RegionFit, OneStiffnessForEqualHalvesAgreesWithTwo) {
  const Identification two = fit_halves({}), one = fit_halves({}, false);
  EXPECT_NEAR(two.parameters[2].value / two.parameters[0].value, 1, 0.25);
  EXPECT_GT(two.parameters[0].std, one.parameters[0].std);
  EXPECT_NEAR(std::log(two.parameters[0].value / one.parameters[0].value), 0, 3 * two.parameters[0].std / two.parameters[0].value);
}

// Both halves are pressed on their own, so that each bulges where it is seen.
Recording both_halves_pressed(bool own) {
  Recording recording = glued_block_recording({Vec3(0, 0, -0.8), Vec3(0, 0, -1.6)}, 0.015, 0.02);
  recording.pushes.push_back(glued_block_recording({Vec3(0, 0, -0.8), Vec3(0, 0, -1.6)}, 0.045, 0.02).pushes[0]);
  recording.pushes[1].name = "free";
  recording.model.poisson_by_region = own;
  return recording;
}

/// On a mesh that errs by a fraction of what noise does; the truth's is half as fine again.
Identification fit_both(const PushedBlock& truth, bool own) {
  SimulatedObject object = simulated(fem::to_quadratic(kuhn_block(8, 6, 4, block_size_m)), "linear");
  put_two_halves(object);
  FitOptions options;
  options.cross_checks = false;
  const Recording recording = both_halves_pressed(own);
  return fit(recording, object, clouds_of(truth, recording), options);
}

TEST(RegionFit, IntervalsHoldThePoissonRatiosOfBothHalves) {
  constexpr int seeds = 8;
  std::array<int, 4> held{};
  double squares = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    PushedBlock truth;
    truth.seed = static_cast<unsigned>(seed);
    truth.material = "linear";
    truth.finer = 3;
    truth.sigma_m = 4e-4;
    truth.points = 400;
    truth.young_pa = 2e4 * (1 + 0.02 * seed);
    truth.free_half = std::exp(0.1 * (seed - 4.5));
    truth.poisson = 0.15 + 0.02 * seed;
    truth.free_poisson = 0.46 - 0.04 * seed;
    const Identification answer = fit_both(truth, true);
    ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
    ASSERT_EQ(answer.parameters.size(), 4u);
    const std::array<double, 4> true_values{truth.young_pa, truth.poisson, truth.free_half * truth.young_pa, *truth.free_poisson};
    for (std::size_t k = 0; k < 4; ++k) {
      const Parameter& one = answer.parameters[k];
      EXPECT_EQ(one.name, k % 2 == 0 ? "young_modulus" : "poisson_ratio");
      EXPECT_EQ(one.region, k < 2 ? "clamped half" : "free half");
      EXPECT_TRUE(one.determined) << one.name << one.region;
      held[k] += holds(one, true_values[k]);
      squares += std::pow((one.value - true_values[k]) / one.std, 2);
      EXPECT_NEAR(std::sqrt(answer.covariance(Index(k), Index(k))) / (k % 2 == 0 ? one.std / one.value : one.std), 1, 0.05);
    }
    EXPECT_GT(answer.covariance.ldlt().vectorD().minCoeff(), 0);
    if (seed > 1) continue;
    const Parameter shared = fit_both(truth, false).parameters[1];  // one ratio for both is wrong, and looks sure of itself
    EXPECT_GT(std::abs(shared.value - truth.poisson), 4 * shared.std);
  }
  for (const int count : held) EXPECT_GE(count, 6);  // 0.95 of eight less three binomial standard deviations
  EXPECT_NEAR(squares / (4 * seeds), 1, 3 * std::sqrt(2.0 / (4 * seeds)));
}

TEST(RegionFit, PoissonRatioOfARegionThatSaysNothingStaysItsPrior) {
  PushedBlock truth;
  truth.free_poisson = 0.2;
  SimulatedObject object = coarse_block();
  put_two_halves(object);
  Recording recording = pushed_block_recording();
  for (auto& step : recording.pushes[0].steps) step.loads[0].contact_m.x() = 0.015;  // the free half is taken along
  recording.model.poisson_by_region = true;
  recording.model.poisson_lower = 0.1;
  recording.model.poisson_upper = 0.4;
  const Identification answer = fit(recording, object, clouds_of(truth, recording), {});
  ASSERT_EQ(answer.parameters.size(), 4u);
  const Parameter& free = answer.parameters[3];
  EXPECT_FALSE(free.determined);
  EXPECT_NEAR(free.value, 0.25, 0.05);
  EXPECT_GE(free.lower_95, 0.1);
  EXPECT_LE(free.upper_95, 0.4);
  EXPECT_TRUE(says(answer, "nu_not_determined"));
}

TEST(RegionFit, RegionThatNoPushReachesIsNotDetermined) {
  // The far end beyond the finger carries nothing: it moves with its neighbours, whatever it is made of.
  SimulatedObject object = coarse_block();
  Recording recording = pushed_block_recording();
  for (auto& step : recording.pushes[0].steps) {
    step.loads[0].contact_m = Vec3(0.015, 0.02, 0.03);
    *step.loads[0].force_n *= 5;
  }
  for (Index e = 0; e < object.mesh.tetrahedra.rows(); ++e)
    object.region.push_back(fem::element_centre(object.mesh, e).x() > 0.045 ? 1 : 0);
  object.region_names = {"held", "end"};
  const Identification answer = fit(recording, object, clouds_of({}, recording), {});
  ASSERT_EQ(answer.parameters.size(), 3u);
  EXPECT_TRUE(answer.parameters[0].determined);
  EXPECT_FALSE(answer.parameters[2].determined);
  EXPECT_TRUE(says(answer, "e_not_determined"));
}

}  // namespace
}  // namespace palpate::estimation::region_fit_test
