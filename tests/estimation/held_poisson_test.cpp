// label: unit
// SPDX-License-Identifier: Apache-2.0
// A Poisson ratio at a bound of its range that the data push it out of: it stays there, and E stays where it is with it, wherever a step is
// taken from the optimum.
#include "palpate/estimation/held_poisson.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "palpate/estimation/own_poisson.hpp"
#include "palpate/estimation/posterior.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::held_poisson_test {
namespace {

/// log E, nu, a region's ratio and its own nu, a nuisance.
Unknowns five() {
  Unknowns unknowns;
  unknowns.add({"log_young", "1"});
  unknowns.add({"poisson", "1", 0.25, 1, 0.1, 0.4});
  unknowns.add_ratios({"other"});
  unknowns.add_own_poisson({"other"}, 0.1, 0.4);
  unknowns.add({"tare", "N", 0, 1});
  return unknowns;
}

TEST(HeldPoisson, WhatMovesIsAllButRatiosThatArePushedOut) {
  Unknowns unknowns = five();
  VectorX at = VectorX::Constant(5, 0.4), gradient = VectorX::Constant(5, -1);
  EXPECT_EQ(moving_unknowns(unknowns, at, gradient), (std::vector<int>{log_young, first_ratio, 4}));
  EXPECT_EQ(moving_unknowns(unknowns, at, -gradient), (std::vector<int>{0, 1, 2, 3, 4})) << "pulled in";
  at(3) = 0.3;
  EXPECT_EQ(moving_unknowns(unknowns, at, gradient), (std::vector<int>{0, 2, 3, 4}));
  at(poisson) = 0.1;
  gradient(poisson) = 2;
  unknowns[4].fixed = true;
  EXPECT_EQ(moving_unknowns(unknowns, at, gradient), (std::vector<int>{0, 2, 3}));
}

TEST(HeldPoisson, AStepEndsWhereTheQuadraticIsLeastInTheRange) {
  const Unknowns unknowns = five();
  const std::vector<int> moving{0, 1, 2, 3, 4};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto draw = [&] { return uniform(random); };
  int stopped = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const MatrixX root = MatrixX::NullaryExpr(5, 5, draw);
    const MatrixX curvature = root * root.transpose() + 0.1 * MatrixX::Identity(5, 5);
    const VectorX gradient = 0.3 * VectorX::NullaryExpr(5, draw);
    VectorX at = VectorX::NullaryExpr(5, draw);
    for (const int k : {1, 3}) at(k) = trial % 3 == 0 ? 0.4 : 0.25 + 0.15 * draw();
    const auto cost = [&](const VectorX& d) { return gradient.dot(d) + 0.5 * d.dot(curvature * d); };
    const NewtonStep step = step_in_range(unknowns, at, curvature, gradient, moving);
    EXPECT_NEAR(step.gain, -cost(step.move), 1e-12);
    EXPECT_FALSE(leaves_range(unknowns, at, moving, (1 - 1e-12) * step.move));
    // No corner and no edge of the range that holds one of the two elsewhere is lower, where all else follows.
    for (double nu = 0.1; nu < 0.4001; nu += 0.05)
      for (double own = 0.1; own < 0.4001; own += 0.05) {
        VectorX d = VectorX::Zero(5);
        d(1) = nu - at(1), d(3) = own - at(3);
        const std::vector<int> others{0, 2, 4}, two{1, 3};
        const VectorX rest = MatrixX(curvature(others, others)).ldlt().solve(-VectorX(gradient(others)) - MatrixX(curvature(others, two)) * VectorX(d(two)));
        d(others) = rest;
        EXPECT_GE(cost(d), -step.gain - 1e-9) << trial << " " << nu << " " << own;
      }
    stopped += at(1) + step.move(1) < 0.1 + 1e-12 || at(1) + step.move(1) > 0.4 - 1e-12;
  }
  EXPECT_GT(stopped, 20);
}

/// Both halves are pressed on their own, and what is pressed has another nu in the free one.
Recording both_halves_pressed() {
  Recording recording = glued_block_recording({Vec3(0, 0, -0.8), Vec3(0, 0, -1.6)}, 0.015, 0.02);
  recording.pushes.push_back(glued_block_recording({Vec3(0, 0, -0.8), Vec3(0, 0, -1.6)}, 0.045, 0.02).pushes[0]);
  recording.pushes[1].name = "free";
  recording.model.poisson_by_region = true;
  return recording;
}

SimulatedObject two_halves() {
  SimulatedObject object = coarse_block("linear");
  put_two_halves(object);
  return object;
}

TEST(HeldPoisson, ARegionsOwnAtItsBoundCostsNoAnswer) {
  PushedBlock truth;
  truth.seed = 4;  // whose noise asks for more than 0.5, most of all in a part of the data
  truth.material = "linear";
  truth.free_poisson = 0.49;
  truth.finer = 1;
  FitOptions options;
  options.stresses = false;
  options.compare_laws = true;
  const Recording recording = both_halves_pressed();
  Identification answer;
  ASSERT_NO_THROW(answer = fit(recording, two_halves(), clouds_of(truth, recording), options));
  ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
  EXPECT_TRUE(says(answer, "nu_at_bound"));
  EXPECT_TRUE(answer.prediction.available);
  EXPECT_LT(answer.prediction.surface_rms_m, 1.2 * truth.sigma_m);
  EXPECT_LT(answer.prediction.force_error, 0.2);
  ASSERT_EQ(answer.laws.size(), 3u);
  EXPECT_TRUE(answer.laws[0].usable) << answer.laws[0].message;
}

/// What was fitted of the pushed block whose nu lies far above its range.
struct Beyond {
  Recording recording = pushed_block_recording();
  Unknowns unknowns;
  std::unique_ptr<ForwardModel> model;
  std::unique_ptr<Objective> objective;
  Beyond() {
    recording.model.poisson_lower = 0.05;
    recording.model.poisson_upper = 0.25;
    PushedBlock truth;
    truth.material = "linear";
    truth.poisson = 0.42;
    truth.sigma_m = 2e-4;
    model = std::make_unique<ForwardModel>(recording, coarse_block("linear"), unknowns);
    objective = std::make_unique<Objective>(*model, clouds_of(truth), unknowns);
  }
};

TEST(HeldPoisson, ASearchWhoseLastStepCameToTheBoundSaysSo) {
  Beyond block;
  VectorX start = block.unknowns.prior_mean();
  start(log_young) = std::log(2e4);
  start(poisson) = 0.2;
  OptimiseOptions one;
  one.max_iterations = 1;
  const Optimum at = optimise(*block.objective, start, {}, one, {});
  ASSERT_TRUE(at.evaluation.usable);
  ASSERT_EQ(at.unknowns(poisson), 0.25);
  EXPECT_TRUE(at.poisson_at_upper);
  EXPECT_FALSE(at.poisson_at_lower);
}

/// Two halves whose nu may lie between bounds, fitted.
struct Halves {
  Recording recording = both_halves_pressed();
  Unknowns unknowns;
  std::unique_ptr<ForwardModel> model;
  std::unique_ptr<Objective> objective;
  Optimum optimum;
  MatrixX covariance;

  Halves(double lower, double upper) {
    PushedBlock truth;
    truth.material = "linear";
    truth.poisson = 0.2;
    truth.free_poisson = 0.32;
    truth.finer = 1;
    truth.sigma_m = 1e-4;
    const Inputs inputs = clouds_of(truth, recording);
    recording.model.poisson_lower = lower;
    recording.model.poisson_upper = upper;
    model = std::make_unique<ForwardModel>(recording, two_halves(), unknowns);
    objective = std::make_unique<Objective>(*model, inputs, unknowns);
    VectorX start = unknowns.prior_mean();
    start(log_young) = std::log(2e4);
    optimum = optimise(*objective, start, {}, {}, {});
    EXPECT_EQ(optimum.termination, Termination::converged) << optimum.message;
    const std::vector<int> moving = free_unknowns(unknowns);
    const MatrixX information = optimum.evaluation.information(1)(moving, moving);
    covariance = information.ldlt().solve(MatrixX::Identity(information.rows(), information.cols()));
  }
  OwnPoisson own() const { return own_poisson(unknowns, optimum, covariance, free_unknowns(unknowns)); }
};

/// What the data say of a held one without its bound is what they say where the bound is far away.
TEST(HeldPoisson, ARegionsOwnIsANormalNumberCutAtItsBoundAndNotOneThatStartsThere) {
  const OwnPoisson open = Halves(0, 0.45).own(), cut = Halves(0, 0.3).own();
  ASSERT_GT(open.mean(0), 0.3 + 1 * open.std(0)) << "this noise asks for less than the bound";
  EXPECT_NEAR(cut.mean(0), open.mean(0), 0.3 * open.std(0));  // the prior is another
  EXPECT_NEAR(cut.std(0), open.std(0), 0.1 * open.std(0));
}

double below(double z) { return 0.5 * std::erfc(-z / std::sqrt(2.0)); }

/// Of two ratios that are normal together one is cut: what is left of the other is the integral over the cut one.
TEST(HeldPoisson, TheSharedNuIsWhatIsLeftOfItOverTheRangeOfTheOther) {
  const Halves open(0, 0.45);
  const int own = open.unknowns.first_own_poisson();
  const std::vector<int> both{poisson, own};
  const VectorX fitted = open.optimum.unknowns(both);
  const MatrixX known = MatrixX(open.covariance(both, both)).inverse();
  const double std_nu = std::sqrt(open.covariance(poisson, poisson)), std_own = std::sqrt(open.covariance(own, own));
  const double lower = fitted(0) - 3 * std_nu;  // so near that nu is looked for in a quadrature
  for (const double beyond : {-1.0, 0.7, 2.0}) {
    const double upper = fitted(1) - beyond * std_own;
    Halves cut(lower, upper);
    // The other prior that this range means.
    const Unknown &was = open.unknowns[own], &is = cut.unknowns[own];
    MatrixX information = known;
    VectorX pulls = known * fitted;
    information(1, 1) += std::pow(is.prior_std, -2) - std::pow(was.prior_std, -2);
    pulls(1) += is.prior_mean * std::pow(is.prior_std, -2) - was.prior_mean * std::pow(was.prior_std, -2);
    const MatrixX covariance = information.inverse();
    const VectorX mean = covariance * pulls;
    const double slope = covariance(0, 1) / covariance(0, 0), left = std::sqrt(covariance(1, 1) - slope * covariance(0, 1));
    const Posterior posterior = explore_posterior(*cut.objective, cut.optimum, {}, 1, {});
    ASSERT_TRUE(posterior.quadrature);
    VectorX wanted(posterior.poisson.size());
    for (Index i = 0; i < wanted.size(); ++i) {
      const double off = posterior.poisson(i) - mean(0), there = mean(1) + slope * off;
      wanted(i) = std::exp(-0.5 * off * off / covariance(0, 0)) * (below((upper - there) / left) - below((lower - there) / left));
    }
    wanted /= wanted.sum();
    const double middle = wanted.dot(posterior.poisson), std_dev = std::sqrt(wanted.dot((posterior.poisson.array() - middle).square().matrix()));
    RecordProperty("moved" + std::to_string(beyond), std::to_string((middle - mean(0)) / std_nu) + " by the cut");
    EXPECT_NEAR(posterior.weight.dot(posterior.poisson), middle, 0.06 * std_nu) << beyond << ": moved by " << (middle - mean(0)) / std_nu;
    EXPECT_NEAR(posterior.poisson_std(), std_dev, 0.06 * std_nu) << beyond;
  }
}

}  // namespace
}  // namespace palpate::estimation::held_poisson_test
