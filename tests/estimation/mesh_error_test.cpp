// label: unit
// SPDX-License-Identifier: Apache-2.0
// What the mesh does to the answer is estimated to the right size, and widens the interval exactly where that can be known.
#include "palpate/estimation/mesh_error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "palpate/estimation/answer_parts.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::mesh_error_test {
namespace {

TEST(MeshError, IsHalfToFourTimesTheBiasThatAFinerTruthShows) {
  Recording recording = pushed_block_recording();
  const TetMesh linear = kuhn_block(4, 3, 2, block_size_m);
  recording.rest.volume = linear;
  recording.rest.surface = SimulatedSurface::boundary_of(linear, nullptr).rest();
  const SimulatedObject coarse = coarse_block();
  PushedBlock truth;
  truth.sigma_m = 1e-5;
  truth.points = 1500;
  const Inputs inputs = clouds_of(truth);
  const auto finer = finer_model(recording, coarse);
  ASSERT_TRUE(finer);
  EXPECT_GT(finer->object.mesh.nodes_m.rows(), 1.3 * static_cast<double>(coarse.mesh.nodes_m.rows()));
  const Identification plain = fit(recording, coarse, inputs, {});
  const Identification widened = fit(recording, coarse, inputs, {}, {}, &*finer);
  const double bias = std::abs(std::log(plain.parameters[0].value / truth.young_pa));
  EXPECT_LT(std::abs(std::log(widened.parameters[0].value / truth.young_pa)), 0.6 * bias) << "most of it is taken out";
  ASSERT_FALSE(widened.budget.empty());
  EXPECT_EQ(widened.budget.front().input, "mesh");  // there is hardly any noise
  const double estimated = widened.budget.front().young_modulus_percent / 100 / finer->unsure;
  EXPECT_GT(estimated, 0.5 * bias);
  EXPECT_LT(estimated, 4 * bias);
  EXPECT_LT(widened.parameters[0].lower_95, truth.young_pa);
  EXPECT_GT(widened.parameters[0].upper_95, truth.young_pa);
}

/// A ball that is moved 1 mm into the block, whose force Hertz tells: what the mesh does is in the force alone.
TEST(MeshError, OfAnImposedMotionIsInTheForceThatItAsksFor) {
  Recording recording = pushed_block_recording();
  const TetMesh linear = kuhn_block(4, 3, 2, block_size_m);
  recording.rest.volume = linear;
  recording.rest.surface = SimulatedSurface::boundary_of(linear, nullptr).rest();
  recording.supports[0].kind = SupportKind::plane;
  recording.supports[0].plane = {Vec3::Zero(), Vec3::UnitZ()};
  recording.tools[0].shape = ToolShape::sphere;
  recording.tools[0].contact = ContactLaw::frictionless;
  recording.model.material = "linear";
  constexpr double young_pa = 20e3, nu = 0.3, depth_m = 1e-3;
  recording.model.poisson_fixed = nu;
  const double hertz_n = 4.0 / 3 * young_pa / (1 - nu * nu) * std::sqrt(recording.tools[0].radius_m) * std::pow(depth_m, 1.5);
  auto& steps = recording.pushes[0].steps;
  steps.resize(1);
  steps[0].loads[0].force_n.reset();
  steps[0].loads[0].travel_m = depth_m;
  steps[0].loads[0].contact_m = Vec3(0.5 * block_size_m.x(), 0.5 * block_size_m.y(), block_size_m.z());
  Wrench wrench;
  wrench.force_n = Vec3(0, 0, -hertz_n);
  wrench.force_sigma_n = 1e-3 * hertz_n;
  const Inputs inputs{{wrench}};
  const SimulatedObject coarse = coarse_block("linear");
  const auto finer = finer_model(recording, coarse);
  ASSERT_TRUE(finer);
  FitOptions options;
  options.cross_checks = false;
  const Identification plain = fit(recording, coarse, inputs, options);
  const Identification widened = fit(recording, coarse, inputs, options, {}, &*finer);
  const double bias = std::log(plain.parameters[0].value / young_pa), left = std::log(widened.parameters[0].value / young_pa);
  EXPECT_LT(bias, -0.05) << "a coarse mesh is stiff: the force needs a smaller E";
  EXPECT_LT(std::abs(left), 0.8 * std::abs(bias));
  ASSERT_FALSE(widened.budget.empty());
  EXPECT_EQ(widened.budget.front().input, "mesh");
  RecordProperty("bias", std::to_string(bias) + " " + std::to_string(left));
}

TEST(MeshError, NeedsARoundToolAndAMeshThatItMayRefine) {
  Recording recording = pushed_block_recording();
  EXPECT_FALSE(finer_model(recording, coarse_block())) << "no volume of its own";
  recording.rest.volume = kuhn_block(4, 3, 2, block_size_m);
  EXPECT_FALSE(finer_model(recording, simulated(*recording.rest.volume, "linear"))) << "linear elements as asked for";
  recording.supports[0].vertices = {0};  // listed nodes: only the edges under tools are halved
  EXPECT_TRUE(finer_model(recording, coarse_block()));
  recording.pushes[0].steps.resize(0);
  EXPECT_FALSE(finer_model(recording, coarse_block())) << "no tool";
}

// A fit whose regions have a nu of their own has one unknown more before its nuisances. Where all nu are held at one value it is
// moved by exactly what moves the fit with one nu for both; and so it is where a foot leans.
TEST(MeshError, MovesRegionsWithANuOfTheirOwnLikeThoseThatShareOne) {
  for (const bool linear : {true, false}) {
    std::vector<AnswerShift> shifts;
    for (const bool own : {false, true}) {
      Recording recording = pushed_block_recording();
      recording.pushes[0].force_tare_std_n = 0.02;
      recording.model.poisson_by_region = own;
      const TetMesh corners = kuhn_block(4, 3, 2, block_size_m);
      recording.rest.volume = corners;
      recording.rest.surface = SimulatedSurface::boundary_of(corners, nullptr).rest();
      SimulatedObject object = coarse_block(linear ? "linear" : "neo_hookean");
      auto finer = finer_model(recording, object);
      ASSERT_TRUE(finer);
      put_two_halves(object);
      put_two_halves(finer->object);
      PushedBlock truth;
      truth.free_half = 1.5;
      Unknowns unknowns;
      ForwardModel model(recording, object, unknowns);
      Objective objective(model, clouds_of(truth), unknowns);
      Optimum at;
      at.unknowns = unknowns.prior_mean();
      at.unknowns(log_young) = std::log(truth.young_pa);
      at.unknowns(poisson) = truth.poisson;
      at.unknowns(first_ratio) = std::log(truth.free_half);
      unknowns[poisson].fixed = true;
      for (int k = unknowns.first_own_poisson(); k < unknowns.parameter_count(); ++k) {
        at.unknowns(k) = truth.poisson;
        unknowns[k].fixed = true;
      }
      at.evaluation = objective.evaluate(at.unknowns, at.loss);
      ASSERT_TRUE(at.evaluation.usable);
      const auto shift = mesh_shift(recording, object, objective, at, at.loss, *finer, {}, {});
      ASSERT_TRUE(shift);
      shifts.push_back(*shift);
    }
    EXPECT_NE(shifts[0].log_young, 0);
    EXPECT_NEAR(shifts[1].log_young, shifts[0].log_young, 1e-6 * std::abs(shifts[0].log_young)) << "linear: " << linear;
    EXPECT_NEAR(shifts[1].region_log_young(0), shifts[0].region_log_young(0), 1e-6 * std::abs(shifts[0].region_log_young(0)));
  }
}

// Nor does E of a region go along with a nu that is held at its bound.
TEST(MeshError, MovesARegionWhoseOwnNuIsHeldAsIfItWereKnown) {
  std::vector<AnswerShift> shifts;
  for (const bool known : {false, true}) {
    Recording recording = glued_block_recording({Vec3(0, 0, -0.8), Vec3(0, 0, -1.6)}, 0.045, 0.02);
    recording.model.poisson_by_region = true;
    recording.model.poisson_upper = 0.2;
    const TetMesh corners = kuhn_block(4, 3, 2, block_size_m);
    recording.rest.volume = corners;
    recording.rest.surface = SimulatedSurface::boundary_of(corners, nullptr).rest();
    SimulatedObject object = coarse_block("linear");
    auto finer = finer_model(recording, object);
    ASSERT_TRUE(finer);
    put_two_halves(object);
    put_two_halves(finer->object);
    PushedBlock truth;
    truth.free_poisson = 0.45;
    truth.material = "linear";
    truth.finer = 1;
    truth.sigma_m = 1e-4;
    Unknowns unknowns;
    ForwardModel model(recording, object, unknowns);
    Objective objective(model, clouds_of(truth, recording), unknowns);
    VectorX start = unknowns.prior_mean();
    start(log_young) = std::log(truth.young_pa);
    const int own = unknowns.first_own_poisson();
    start(own) = start(poisson) = 0.2;
    unknowns[own].fixed = known;
    unknowns[poisson].fixed = true;
    const Optimum at = optimise(objective, start, {}, {}, {});
    ASSERT_EQ(at.termination, Termination::converged) << at.message;
    ASSERT_EQ(at.unknowns(own), 0.2);
    const auto shift = mesh_shift(recording, object, objective, at, at.loss, *finer, {}, {});
    ASSERT_TRUE(shift);
    shifts.push_back(*shift);
  }
  EXPECT_EQ(shifts[0].region_poisson(0), 0);
  EXPECT_NEAR(shifts[0].log_young, shifts[1].log_young, 1e-3 * std::abs(shifts[1].log_young));
  EXPECT_NEAR(shifts[0].region_log_young(0), shifts[1].region_log_young(0), 1e-3 * std::abs(shifts[1].region_log_young(0)));
}

// What the mesh does to both halves at once is shared by them, and so in their covariance: E of both is off together or apart.
TEST(MeshError, OfTwoRegionsIsInTheirCovariance) {
  Recording recording = pushed_block_recording();
  const TetMesh corners = kuhn_block(4, 3, 2, block_size_m);
  recording.rest.volume = corners;
  recording.rest.surface = SimulatedSurface::boundary_of(corners, nullptr).rest();
  recording.model.poisson_fixed = 0.3;
  SimulatedObject object = coarse_block("linear");
  auto finer = finer_model(recording, object);
  ASSERT_TRUE(finer);
  put_two_halves(object);
  put_two_halves(finer->object);
  PushedBlock truth;
  truth.material = "linear";
  truth.sigma_m = 1e-4;
  truth.points = 800;
  FitOptions options;
  options.cross_checks = options.stresses = false;
  const Inputs inputs = clouds_of(truth, recording);
  const Identification plain = fit(recording, object, inputs, options), widened = fit(recording, object, inputs, options, {}, &*finer);
  ASSERT_EQ(widened.covariance.rows(), 3);
  const auto mesh = std::find_if(widened.budget.begin(), widened.budget.end(), [](const auto& e) { return e.input == "mesh"; });
  ASSERT_NE(mesh, widened.budget.end());
  ASSERT_EQ(mesh->regions.size(), 2u);
  const double product = mesh->regions[0].young_modulus_percent * mesh->regions[1].young_modulus_percent / 1e4;
  EXPECT_GT(product, 0.2 * std::abs(plain.covariance(0, 2))) << "it matters";
  EXPECT_NEAR(std::abs(widened.covariance(0, 2) - plain.covariance(0, 2)), product, 0.05 * product);
  for (const Index k : {0, 2})
    EXPECT_NEAR(widened.covariance(k, k) - plain.covariance(k, k), std::pow(mesh->regions[std::size_t(k / 2)].young_modulus_percent / 100, 2),
                0.02 * widened.covariance(k, k));
}

/// Normal posterior of (log E, nu) on a grid, cut at bounds of nu.
Posterior normal_posterior(double log_young, double nu, double var_e, double cov, double var_nu, double lower = -1, double upper = 1) {
  Posterior p;
  const Index n = 401;
  const double sd = std::sqrt(var_nu);
  p.poisson = VectorX::LinSpaced(n, std::max(lower, nu - 5 * sd), std::min(upper, nu + 5 * sd));
  const VectorX off = p.poisson.array() - nu;
  p.weight = (-0.5 * off.array().square() / var_nu).exp();
  p.weight /= p.weight.sum();
  p.log_young_mean = log_young + cov / var_nu * off.array();
  p.log_young_std = VectorX::Constant(n, std::sqrt(var_e - cov * cov / var_nu));
  update_covariance(p);
  return p;
}

TEST(Widening, OfTwoRegionsAddsTheProductsOfTheirShifts) {
  // (log E of the first, nu, log E of the second)
  Mat3 before;
  before << 4e-4, -1e-4, 1e-4, -1e-4, 4e-4, 0.5e-4, 1e-4, 0.5e-4, 9e-4;
  std::vector<Posterior> regions{normal_posterior(9, 0.25, before(0, 0), before(0, 1), before(1, 1)),
                                 normal_posterior(10, 0.25, before(2, 2), before(2, 1), before(1, 1))};
  const auto given_nu = [&](int a, int b) { return before(a, b) - before(a, 1) * before(b, 1) / before(1, 1); };
  regions[0].correlation = MatrixX::Identity(2, 2);
  regions[0].correlation(0, 1) = regions[0].correlation(1, 0) = given_nu(0, 2) / std::sqrt(given_nu(0, 0) * given_nu(2, 2));
  ASSERT_LT((covariance_of(regions) - before).norm(), 2e-3 * before.norm());
  for (const AnswerShift& shift : {AnswerShift{0.03, 0.01, VectorX::Constant(1, -0.02)}, AnswerShift{-0.01, 0.02, VectorX::Constant(1, -0.03)},
                                   AnswerShift{0.02, 0, VectorX::Constant(1, 0.02)}}) {
    auto wider = regions;
    widen_together(wider, shift, -0.5, 0.499);
    const Vec3 all(shift.log_young, shift.poisson, shift.region_log_young(0));
    const Mat3 expected = before + all * all.transpose();
    EXPECT_LT((covariance_of(wider) - expected).norm(), 0.02 * expected.norm()) << covariance_of(wider) << "\n" << expected;
    // Each by itself is what it was when it was widened alone.
    for (Index r = 0; r < 2; ++r) {
      Posterior alone = regions[std::size_t(r)];
      widen(alone, shift.of_region(r), -0.5, 0.499);
      EXPECT_EQ(wider[std::size_t(r)].covariance, alone.covariance);
    }
  }
}

TEST(Widening, AddsTheOuterProductOfTheShiftToANormalPosterior) {
  for (const AnswerShift& shift : {AnswerShift{0.02, 0.01, {}}, AnswerShift{-0.03, 0.004, {}}, AnswerShift{0.01, 0, {}}, AnswerShift{0, 0.02, {}}}) {
    Posterior p = normal_posterior(9.5, 0.25, 4e-4, -1.2e-4, 1e-4);
    const MatrixX before = p.covariance;
    widen(p, shift, 0, 0.4995);
    Eigen::Matrix2d wanted = before;
    const Eigen::Vector2d d(shift.log_young, shift.poisson);
    wanted += d * d.transpose();
    EXPECT_LT((p.covariance - wanted).cwiseAbs().maxCoeff(), 2e-3 * wanted.cwiseAbs().maxCoeff())
        << shift.log_young << " " << shift.poisson << "\n" << p.covariance << "\nwanted\n" << wanted;
    EXPECT_NEAR(p.poisson_quantile(0.5), 0.25, 1e-4);
    EXPECT_NEAR(p.log_young_quantile(0.5), 9.5, 1e-4);
  }
}

// From far below the grid's steps to far above its width: no size of the error makes an interval narrower.
TEST(Widening, IsRightForErrorsOfEverySize) {
  for (double size = 1e-5; size < 10; size *= 1.7) {
    Posterior p = normal_posterior(9.5, 0.25, 4e-6, -1.2e-6, 1e-6);
    const AnswerShift shift{0.5e-3 * size, 1e-3 * size, {}};  // in standard deviations of nu, and half as many of log E
    Eigen::Matrix2d wanted = p.covariance;
    const Eigen::Vector2d d(shift.log_young, shift.poisson);
    wanted += d * d.transpose();
    widen(p, shift, 0, 0.4995);
    const Eigen::Vector2d scale = wanted.diagonal().cwiseSqrt().cwiseInverse();
    EXPECT_LT((scale.asDiagonal() * (p.covariance - wanted) * scale.asDiagonal()).cwiseAbs().maxCoeff(), 5e-3) << size;
  }
}

TEST(Moving, TakesANormalPosteriorAlongAndKeepsTheBoundsOfNu) {
  Posterior p = normal_posterior(9.5, 0.25, 4e-4, -1.2e-4, 1e-4);
  const MatrixX before = p.covariance;
  move(p, {-0.02, 0.01, {}}, 0, 0.4995);
  EXPECT_LT((p.covariance - before).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_NEAR(p.poisson_quantile(0.5), 0.26, 1e-4);
  EXPECT_NEAR(p.log_young_quantile(0.5), 9.48, 1e-4);

  // Far outside, nu stays at its bound, and E is what it would be at that nu: ten deviations on along the ridge, 9.5 - 0.02 + 1.2 * 0.11.
  Posterior bound = normal_posterior(9.5, 0.4, 4e-4, -1.2e-4, 1e-4, 0, 0.3);
  const double nu = bound.poisson_quantile(0.5), log_e = bound.log_young_quantile(0.5);
  move(bound, {-0.02, 0.01, {}}, 0, 0.3);
  EXPECT_NEAR(bound.poisson_quantile(0.5), nu, 2e-4);
  EXPECT_NEAR(bound.log_young_quantile(0.5), log_e - 0.02 + 1.2 * 0.01, 5e-4);
}

// A normal one that is cut and then moved is the moved one cut, wherever the bounds lie, in or out over them.
TEST(Moving, IsThatOfTheUncutPosteriorCutAgain) {
  for (const double nu : {0.1, 0.02, 0.005, -0.02})
    for (const double by : {-0.012, -0.004, 0.0005, 0.004, 0.012}) {
      Posterior moved = normal_posterior(9.5, nu, 4e-4, -1.2e-4, 4e-4, 0, 0.4995);
      move(moved, {-0.02, by, {}}, 0, 0.4995);
      const Posterior wanted = normal_posterior(9.48, nu + by, 4e-4, -1.2e-4, 4e-4, 0, 0.4995);
      EXPECT_GE(moved.poisson.minCoeff(), 0);
      for (const double p : {0.025, 0.16, 0.5, 0.84, 0.975}) {
        EXPECT_NEAR(moved.poisson_quantile(p), wanted.poisson_quantile(p), 4e-4) << nu << " " << by << " " << p;
        EXPECT_NEAR(moved.log_young_quantile(p), wanted.log_young_quantile(p), 4e-4) << nu << " " << by << " " << p;
      }
    }
}

TEST(Widening, KeepsTheBoundsOfNu) {
  Posterior p = normal_posterior(9.5, 0.45, 4e-4, -1.2e-4, 1e-4);
  widen(p, {0.02, 0.03, {}}, 0, 0.4995);
  EXPECT_LE(p.poisson_quantile(0.999), 0.4995);
  EXPECT_LT(p.poisson_quantile(0.025), 0.42);
}

}  // namespace
}  // namespace palpate::estimation::mesh_error_test
