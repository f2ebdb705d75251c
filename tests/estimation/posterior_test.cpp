// label: unit
// SPDX-License-Identifier: Apache-2.0
// Numbers read from a posterior against the normal distribution, whole and cut.
#include "palpate/estimation/posterior.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "palpate/estimation/verdicts.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::posterior_test {
namespace {

double normal_cdf(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

double normal_quantile(double probability) {
  double low = -10, high = 10;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    (normal_cdf(middle) < probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// A pushed linear block whose surface vertices are all seen as markers.
struct Fitted {
  Recording recording = pushed_block_recording();
  Unknowns unknowns;
  std::unique_ptr<ForwardModel> model;
  std::unique_ptr<Objective> objective;
  Inputs inputs;
  Optimum optimum;
  Loss loss;

  /// @param upper  of nu's prior
  Fitted(double sigma_m, double upper, double true_nu, const std::string& material = "linear") {
    recording.model.poisson_upper = upper;
    model = std::make_unique<ForwardModel>(recording, simulated(kuhn_block(3, 2, 2, block_size_m), material), unknowns);
    // Markers: no correspondences, no robust loss, so that the cost is smooth. Made without noise by this very model.
    VectorX truth = unknowns.prior_mean();
    truth(log_young) = std::log(2e4);
    truth(poisson) = true_nu;
    for (std::size_t s = 0; s < model->step_count(); ++s) {
      const Points rest_m = model->object().surface.rest().vertices_m;
      Markers markers;
      markers.rest_m = rest_m;
      markers.observed_m = model->predict(s, truth).surface_m;
      // A marker follows its patch's mean motion, so what it shows is made by the same rule below.
      markers.sigma_m = sigma_m;
      std::map<std::string, int> shared;
      Unknowns none = unknowns;
      const auto term = make_term(markers, {*model, s, none, shared});
      const VectorX off = term->rows(model->predict(s, truth), truth, {}).residual * sigma_m;
      for (Index m = 0; m < rest_m.rows(); ++m) markers.observed_m.row(m) -= off.segment<3>(3 * m).transpose();
      inputs.push_back({markers});
    }
    objective = std::make_unique<Objective>(*model, inputs, unknowns);
    VectorX start = truth;
    start(log_young) += 0.1;
    start(poisson) = 0.25;
    optimum = optimise(*objective, start, loss, {}, {});
  }
};

TEST(LaplacePosterior, QuantilesAreNormal) {
  Fitted fitted(1e-5, 0.4995, 0.3);
  ASSERT_EQ(fitted.optimum.termination, Termination::converged) << fitted.optimum.message;
  const Posterior posterior = explore_posterior(*fitted.objective, fitted.optimum, fitted.loss, 1, {});
  ASSERT_FALSE(posterior.quadrature);
  const MatrixX covariance = fitted.optimum.evaluation.hessian.topLeftCorner<2, 2>().inverse();
  const double std_e = std::sqrt(covariance(0, 0)), std_nu = std::sqrt(covariance(1, 1));
  EXPECT_NEAR(fitted.optimum.unknowns(poisson), 0.3, 1e-3 * std_nu);
  EXPECT_NEAR(posterior.log_young_std_total(), std_e, 1e-3 * std_e);
  EXPECT_NEAR(posterior.poisson_std(), std_nu, 1e-3 * std_nu);
  EXPECT_NEAR(posterior.covariance(0, 1), covariance(0, 1), 1e-3 * std_e * std_nu);
  for (double p : {0.025, 0.16, 0.5, 0.84, 0.975}) {
    EXPECT_NEAR(posterior.poisson_quantile(p), 0.3 + normal_quantile(p) * std_nu, 5e-3 * std_nu) << p;
    EXPECT_NEAR(posterior.log_young_quantile(p), std::log(2e4) + normal_quantile(p) * std_e, 5e-3 * std_e) << p;
  }
  const PosteriorGrid grid = posterior_grid(posterior);
  const VectorX log_e = grid.young_modulus_pa.array().log();
  const double cell = (log_e(1) - log_e(0)) * (grid.poisson_ratio(1) - grid.poisson_ratio(0));
  EXPECT_NEAR(grid.density.sum() * cell, 1, 0.02);
}

TEST(PosteriorAtTheBound, IsTheTruncatedNormal) {
  // The truth lies at 0.3 and nu may not pass 0.3 by more than 0.6 of its standard deviation.
  const Fitted open(2e-6, 0.4995, 0.3);
  const MatrixX covariance = open.optimum.evaluation.hessian.topLeftCorner<2, 2>().inverse();
  const double std_nu = std::sqrt(covariance(1, 1)), upper = 0.3 + 0.6 * std_nu;
  ASSERT_LT(std_nu, 0.003);  // so near that the model is linear in nu and the normal is the truth
  Fitted cut(2e-6, upper, 0.3);
  const Posterior posterior = explore_posterior(*cut.objective, cut.optimum, cut.loss, 1, {});
  ASSERT_TRUE(posterior.quadrature);
  const double mass = normal_cdf(0.6);
  for (double p : {0.025, 0.16, 0.5, 0.84, 0.975}) {
    EXPECT_NEAR(posterior.poisson_quantile(p), 0.3 + normal_quantile(p * mass) * std_nu, 0.06 * std_nu) << p;
  }
  EXPECT_LE(posterior.poisson_quantile(0.9999), upper);
  // Mean of a normal cut from above: -phi / Phi.
  const double mean = 0.3 - std_nu * std::exp(-0.18) / std::sqrt(2 * EIGEN_PI) / mass;
  EXPECT_NEAR(posterior.weight.dot(posterior.poisson), mean, 0.05 * std_nu);
}

TEST(PosteriorWithoutEquilibria, SaysWhereNothingWasFound) {
  Fitted fitted(1e-4, 0.4995, 0.3, "neo_hookean");
  ASSERT_EQ(fitted.optimum.termination, Termination::converged) << fitted.optimum.message;
  const Posterior whole = explore_posterior(*fitted.objective, fitted.optimum, fitted.loss, 1, {});
  ASSERT_TRUE(whole.quadrature);
  EXPECT_FALSE(whole.unsolved_below || whole.unsolved_above);
  EXPECT_FALSE(nu_not_explored(whole));
  // The same object by a solver that may take no step finds none at any other nu.
  fem::StaticsOptions no_steps;
  no_steps.max_newton_steps = no_steps.max_load_steps = 0;
  Unknowns unknowns;
  ForwardModel stuck(fitted.recording, fitted.model->object(), unknowns, no_steps);
  Objective objective(stuck, fitted.inputs, unknowns);
  const Posterior cut = explore_posterior(objective, fitted.optimum, fitted.loss, 1, {});
  ASSERT_TRUE(cut.unsolved_below && cut.unsolved_above);
  EXPECT_LT(*cut.unsolved_below, fitted.optimum.unknowns(poisson));
  EXPECT_GT(*cut.unsolved_above, fitted.optimum.unknowns(poisson));
  const std::optional<Verdict> said = nu_not_explored(cut);
  ASSERT_TRUE(said);
  EXPECT_EQ(said->code, "nu_not_explored");
  EXPECT_NE(said->message.find(" and below, nor at "), std::string::npos) << said->message;
}

}  // namespace
}  // namespace palpate::estimation::posterior_test
