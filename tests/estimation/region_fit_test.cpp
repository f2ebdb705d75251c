// label: unit
// SPDX-License-Identifier: Apache-2.0
// A block whose halves differ in stiffness: what each half is, how often its interval holds it, and that one stiffness for
// both is not believed.
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/estimation/fit.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation {
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

TEST(RegionFit, OneStiffnessForEqualHalvesAgreesWithTwo) {
  const Identification two = fit_halves({}), one = fit_halves({}, false);
  EXPECT_NEAR(two.parameters[2].value / two.parameters[0].value, 1, 0.25);
  EXPECT_GT(two.parameters[0].std, one.parameters[0].std);
  EXPECT_NEAR(std::log(two.parameters[0].value / one.parameters[0].value), 0, 3 * two.parameters[0].std / two.parameters[0].value);
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
}  // namespace palpate::estimation
