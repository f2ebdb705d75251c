// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The paper's method as a baseline must be a fair one: it reaches the minimum of its own error function.
#include "palpate/estimation/paper_method.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::paper_method_test {
namespace {

TEST(PaperMethod, ReachesTheMinimumThatAGridSearchFinds) {
  PushedBlock truth;
  truth.points = 150;
  const Recording recording = pushed_block_recording();
  const SimulatedObject object = simulated(kuhn_block(6, 4, 3, block_size_m), "linear");
  truth.material = "linear";
  const Inputs inputs = clouds_of(truth);
  const Identification answer = fit_as_in_paper(recording, object, inputs, {});
  ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
  const double young_pa = parameter(answer, "young_modulus").value, nu = parameter(answer, "poisson_ratio").value;

  PaperError error(recording, object, inputs, {});
  const double reached = error(young_pa, nu);
  EXPECT_NEAR(std::sqrt(reached), answer.fit.rms_m, 1e-3 * answer.fit.rms_m);
  double lowest = std::numeric_limits<double>::infinity(), at_pa = 0, at_nu = 0;
  for (int i = -12; i <= 12; ++i) {
    for (int j = 0; j <= 9; ++j) {
      const double e = 2e4 * std::exp(0.06 * i), n = std::min(0.05 * j + 0.02, 0.4995);
      const double value = error(e, n);
      if (value < lowest) {
        lowest = value;
        at_pa = e;
        at_nu = n;
      }
    }
  }
  // Correspondences are found anew at every evaluation: the error is only smooth up to a small roughness.
  EXPECT_LT(reached, lowest * 1.002) << "the grid's best is E " << at_pa << " nu " << at_nu << ", the method ended at E "
                                     << young_pa << " nu " << nu;
  EXPECT_TRUE(says(answer, "no_uncertainty"));
}

TEST(PaperMethod, TakesTheSlopeOfTheSideThatHasAnEquilibrium) {
  constexpr double none = std::numeric_limits<double>::infinity();
  EXPECT_DOUBLE_EQ(slope({0.9, 1}, {1, 3}, {1.1, 7}), 30);
  EXPECT_DOUBLE_EQ(slope({0.9, none}, {1, 3}, {1.5, 7}), 8);
  EXPECT_DOUBLE_EQ(slope({0.5, 1}, {1, 3}, {1.1, none}), 4);
  EXPECT_DOUBLE_EQ(slope({0.9, none}, {1, 3}, {1.1, none}), 0);
}

// Where the start has no equilibrium the other method looks at a quarter and at four times of its E; so does this one.
TEST(PaperMethod, LooksElsewhereWhereItsStartHasNoEquilibrium) {
  PushedBlock truth;
  truth.points = 60;
  const Recording recording = pushed_block_recording();
  const SimulatedObject object = coarse_block();
  const Inputs inputs = clouds_of(truth);
  PaperError error(recording, object, inputs, {});
  double soft_pa = truth.young_pa / 1024;
  while (soft_pa > 0.1 && std::isfinite(error(soft_pa, 0.3))) soft_pa /= 4;
  ASSERT_GT(soft_pa, 0.1) << "this body bears everything";
  ASSERT_TRUE(std::isfinite(error(4 * soft_pa, 0.3)));
  FitOptions from_there;
  from_there.max_iterations = 1;
  from_there.young_start_pa = soft_pa;
  const Identification answer = fit_as_in_paper(recording, object, inputs, from_there);
  EXPECT_NE(answer.termination, Termination::failed) << answer.message;
  EXPECT_GT(parameter(answer, "young_modulus").value, soft_pa);
  EXPECT_TRUE(std::isfinite(answer.fit.rms_m));
  from_there.young_start_pa = soft_pa / 16;  // nor is there one at four times of this
  EXPECT_EQ(fit_as_in_paper(recording, object, inputs, from_there).termination, Termination::failed);
}

// The search for the start that both methods share is counted with either.
TEST(PaperMethod, CountsWhatItsStartTook) {
  PushedBlock truth;
  truth.points = 60;
  const Recording recording = pushed_block_recording();
  const SimulatedObject object = coarse_block();
  const Inputs inputs = clouds_of(truth);
  FitOptions given;
  given.young_start_pa = truth.young_pa;
  EXPECT_EQ(PaperError(recording, object, inputs, given).solves(), 0);
  const PaperError searched(recording, object, inputs, {});
  EXPECT_GT(searched.solves(), 0);
  EXPECT_GT(searched.load_cases(), 0);
}

TEST(PaperMethod, WithoutASurfaceIsAnError) {
  Inputs inputs(2);
  inputs[0].push_back(ToolTravel{"finger", 0.001, 1e-4});
  EXPECT_THROW(PaperError(pushed_block_recording(), coarse_block(), inputs, {}), Error);
}

}  // namespace
}  // namespace palpate::estimation::paper_method_test
