// label: unit
// SPDX-License-Identifier: Apache-2.0
// When a search has arrived.
#include "palpate/estimation/optimise.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <memory>

#include "pushed_block.hpp"

namespace palpate::estimation::optimise_test {
namespace {

struct Searched {
  Recording recording = pushed_block_recording();
  Unknowns unknowns;
  std::unique_ptr<ForwardModel> model;
  std::unique_ptr<Objective> objective;
  Optimum optimum;
  Searched() {
    PushedBlock truth;
    truth.material = "linear";
    truth.sigma_m = 2e-4;
    model = std::make_unique<ForwardModel>(recording, coarse_block("linear"), unknowns);
    objective = std::make_unique<Objective>(*model, clouds_of(truth), unknowns);
    VectorX start = unknowns.prior_mean();
    start(log_young) = std::log(truth.young_pa);
    start(poisson) = truth.poisson;
    optimum = optimise(*objective, start, {}, {}, {});
  }
  /// One step from a place that is so many standard deviations of E away.
  Optimum one_step_from(double stds) {
    const MatrixX covariance = MatrixX(optimum.evaluation.curvature).inverse();
    VectorX start = optimum.unknowns;
    start(log_young) += stds * std::sqrt(covariance(log_young, log_young));
    OptimiseOptions one;
    one.max_iterations = 1;
    return optimise(*objective, start, {}, one, {});
  }
};

// A search whose steps are larger than its tolerance to the last may be where nothing is to be gained any more: in a valley that hardly
// falls it would go on for hundreds of steps.
TEST(Optimise, ALastStepThatLeavesNothingToGainIsAnEnd) {
  Searched block;
  ASSERT_EQ(block.optimum.termination, Termination::converged) << block.optimum.message;
  const Optimum near = block.one_step_from(0.3);
  EXPECT_EQ(near.termination, Termination::converged) << near.message;
  EXPECT_LT(near.evaluation.cost - block.optimum.evaluation.cost, 0.02);
}

TEST(Optimise, OneThatStillFallsIsNot) {
  Searched block;
  VectorX far = block.optimum.unknowns;
  far(log_young) += std::log(30.0);
  OptimiseOptions one;
  one.max_iterations = 1;
  const Optimum at = optimise(*block.objective, far, {}, one, {});
  EXPECT_EQ(at.termination, Termination::max_iterations);
  EXPECT_EQ(at.message, "stopped after 1 iterations");
}

}  // namespace
}  // namespace palpate::estimation::optimise_test
