// label: unit
// SPDX-License-Identifier: Apache-2.0
// Noise that neighbours of a frame share: found where it is, told from what comes again in every frame, and integrated out as
// linear algebra of the dense covariance says.
#include "palpate/estimation/shared_noise.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <functional>

#include "palpate/estimation/objective.hpp"
#include "palpate/estimation/surface_quadratic.hpp"
#include "pushed_block.hpp"
#include "random_field.hpp"

namespace palpate::estimation::shared_noise_test {
namespace {

constexpr double length_m = 6e-3, share = 0.15;

using Disturb = std::function<void(std::size_t frame, PointCloud& cloud)>;

/// A block that is pressed in six steps, with clouds that something is done to.
struct Scene {
  Recording recording = pushed_block_recording();
  Unknowns unknowns;
  std::unique_ptr<ForwardModel> model;
  std::unique_ptr<Objective> objective;
  VectorX truth;
  Loss loss;

  explicit Scene(const Disturb& disturb, double young_off = 0) {
    PushedBlock block;
    block.material = "linear";
    block.points = 1200;
    Push& push = recording.pushes[0];
    const Step last = push.steps.back();
    push.steps.clear();
    for (int k = 1; k <= 6; ++k) {
      push.steps.push_back(last);
      push.steps.back().loads[0].force_n = Vec3(0, 0, -0.02 * k);
    }
    Inputs inputs = clouds_of(block, recording);
    for (std::size_t s = 0; s < inputs.size(); ++s) {
      auto& cloud = std::get<PointCloud>(inputs[s][0]);
      disturb(s, cloud);
      cloud.pose_std_m = 5e-4;
      cloud.pose_std_rad = 2e-3;
    }
    model = std::make_unique<ForwardModel>(recording, coarse_block("linear"), unknowns);
    objective = std::make_unique<Objective>(*model, inputs, unknowns);
    truth = unknowns.prior_mean();
    truth(log_young) = std::log(block.young_pa) + young_off;
    truth(poisson) = block.poisson;
    objective->evaluate(truth, loss);
  }
};

void add_field(PointCloud& cloud, std::uint64_t seed, double over_m = length_m) {
  lab::Random random(seed, 1);
  const double std_m = std::sqrt(share) * cloud.sigma_m(0);
  const std::array<coverage::RandomField, 3> field{coverage::RandomField(std_m, over_m, random), coverage::RandomField(std_m, over_m, random),
                                                   coverage::RandomField(std_m, over_m, random)};
  for (Index i = 0; i < cloud.points_m.rows(); ++i) {
    const Vec3 at = cloud.points_m.row(i);
    cloud.points_m.row(i) += Vec3(field[0].at(at), field[1].at(at), field[2].at(at)).transpose();
  }
}

void of_its_own(std::size_t frame, PointCloud& cloud) { add_field(cloud, 10 + frame); }

TEST(SharedNoise, IsFoundWhereItIsNewInEveryFrame) {
  const Scene scene(of_its_own);
  const auto found = correlation_of_noise(*scene.objective, scene.loss);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->share, share, 0.35 * share);
  EXPECT_NEAR(found->length_m, length_m, 0.35 * length_m);
}

TEST(SharedNoise, IsPartOfTheStatedVarianceWhereThatHoldsIt) {
  const Scene scene([](std::size_t frame, PointCloud& cloud) {
    of_its_own(frame, cloud);
    cloud.sigma_m *= 1.5;
  });
  const auto found = correlation_of_noise(*scene.objective, scene.loss);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->own + found->share, (1 + share) / (1.5 * 1.5), 0.05);
  const auto beside = correlation_of_noise(*Scene(of_its_own).objective, Loss{});
  ASSERT_TRUE(beside);
  EXPECT_NEAR(beside->own, 1, 0.05);
}

TEST(SharedNoise, IsNotWhatPointsErrByThemselves) {
  const Scene scene([](std::size_t, PointCloud&) {});
  EXPECT_FALSE(correlation_of_noise(*scene.objective, scene.loss));
}

TEST(SharedNoise, IsNotWhatComesAgainInEveryFrame) {
  const Scene same([](std::size_t, PointCloud& cloud) { add_field(cloud, 10); });
  EXPECT_FALSE(correlation_of_noise(*same.objective, same.loss));
  // A modulus that is wrong makes neighbours agree, too, and more so the higher the force.
  const Scene wrong([](std::size_t, PointCloud&) {}, 0.1);
  EXPECT_FALSE(correlation_of_noise(*wrong.objective, wrong.loss));
}

/// What the noise adds to the covariance of residuals that are independent otherwise.
MatrixX covariance_of(const SharedNoise& noise) {
  const MatrixX modes = noise.modes();
  return modes * noise.prior().llt().solve(modes.transpose());
}

TEST(SharedNoise, HasTheCovarianceThatItIsAskedFor) {
  const Scene scene(of_its_own);
  const TermRows& rows = scene.objective->last_rows()[2][0];
  const SharedNoise noise(rows, scene.loss, {share, length_m});
  const MatrixX covariance = covariance_of(noise);
  double squares = 0, count = 0;
  for (Index i = 0; i < covariance.rows(); ++i) {
    for (Index k = 0; k < covariance.cols(); ++k) {
      const double d2 = (rows.met_m.row(i) - rows.met_m.row(k)).squaredNorm();
      if (noise.weight()(i) == 0 || noise.weight()(k) == 0 || d2 > std::pow(3 * length_m, 2)) continue;
      const double off = covariance(i, k) / share - std::exp(-0.5 * d2 / (length_m * length_m));
      ASSERT_LT(std::abs(off), 0.25) << std::sqrt(d2);  // in a corner, beyond which there are no places
      squares += off * off;
      count += 1;
    }
  }
  EXPECT_LT(std::sqrt(squares / count), 0.02);
}

TEST(SharedNoise, IsIntegratedOutAsTheDenseCovarianceSays) {
  Scene scene(of_its_own);
  scene.loss.surface_weight = 0.8;
  TermRows rows = scene.objective->last_rows()[2][0];
  rows.shared_noise = std::make_shared<const SharedNoise>(rows, scene.loss, NoiseCorrelation{share, length_m});
  Evaluation out = Evaluation::nothing(scene.unknowns.size());
  add_rows(rows, scene.loss, rows.unknowns, out);

  // Weights stand for variances: 1 / w each, of the shared part 1 / 0.8.
  std::vector<Index> kept;
  for (Index i = 0; i < rows.residual.size(); ++i)
    if (rows.shared_noise->weight()(i) > 1e-6) kept.push_back(i);
  MatrixX variance = covariance_of(*rows.shared_noise)(kept, kept) / 0.8;
  variance.diagonal() += VectorX(rows.shared_noise->weight()(kept)).cwiseInverse() / 0.8;
  const MatrixX slopes = rows.jacobian(kept, Eigen::all);
  const VectorX residual = rows.residual(kept);
  const Eigen::LLT<MatrixX> dense(variance);
  const MatrixX hessian = slopes.transpose() * dense.solve(slopes);
  const VectorX gradient = slopes.transpose() * dense.solve(residual);
  EXPECT_NEAR(out.robust_cost, 0.5 * residual.dot(dense.solve(residual)), 1e-6 * out.robust_cost);
  for (std::size_t a = 0; a < rows.unknowns.size(); ++a) {
    const auto at = static_cast<Index>(a);
    EXPECT_NEAR(out.gradient(rows.unknowns[a]), gradient(at), 1e-6 * std::sqrt(hessian(at, at)) * residual.norm());
    EXPECT_NEAR(out.hessian(rows.unknowns[a], rows.unknowns[a]), hessian(at, at), 1e-6 * hessian(at, at));
  }
  Evaluation alone = Evaluation::nothing(scene.unknowns.size());
  rows.shared_noise = nullptr;
  add_rows(rows, scene.loss, rows.unknowns, alone);
  EXPECT_LT(out.hessian(log_young, log_young), 0.9 * alone.hessian(log_young, log_young)) << "neighbours that err together say less";
}

TEST(SharedNoise, OfAShortLengthMakesPointsCountAsFewer) {
  const double short_m = 3e-3;
  const Scene scene([&](std::size_t frame, PointCloud& cloud) { add_field(cloud, 10 + frame, short_m); });
  const auto found = shared_noise(*scene.objective, scene.loss);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->terms.empty()) << "a place for every point";
  // Points on faces, that share with those around them: 2 pi l^2 of the block's surface, less at its edges.
  const Vec3 size = block_size_m;
  const double area_m2 = 2 * (size.x() * size.y() + size.y() * size.z() + size.z() * size.x());
  const auto& [shared, over_m, own, deviate] = found->correlation;
  const double neighbours = 1200 * 2 * EIGEN_PI * over_m * over_m / area_m2;
  EXPECT_NEAR(found->of_wide, (own + shared * (1 + neighbours)) / (own + shared), 0.1) << over_m << " m, " << shared;
  const auto wide = shared_noise(*Scene(of_its_own).objective, Loss{});
  ASSERT_TRUE(wide);
  EXPECT_GT(wide->of_wide, found->of_wide);
}

TEST(SharedNoise, IsInTheQuadraticFormOfTheSurface) {
  Scene scene(of_its_own);
  auto noises = std::make_shared<SharedNoises>();
  noises->terms.resize(scene.recording.pushes[0].steps.size());
  noises->terms[2] = {std::make_shared<const SharedNoise>(scene.objective->last_rows()[2][0], scene.loss, NoiseCorrelation{share, length_m})};
  scene.loss.noise = noises;
  scene.loss.surface_weight = 0.8;
  const StepPrediction there = scene.model->predict(2, scene.truth);
  const std::vector<TermRows> rows = scene.objective->rows_of(2, there, scene.truth, scene.loss, true);
  ASSERT_TRUE(rows[0].shared_noise);
  const SurfacePattern pattern(scene.model->object().surface.rest());
  SurfaceQuadratic form(pattern, rows[0], scene.loss, there, scene.truth);
  std::vector<int> places = there.columns;
  places.insert(places.end(), form.own().begin(), form.own().end());
  Evaluation of_form = Evaluation::nothing(scene.unknowns.size()), of_rows = of_form;
  form.add_to(there, scene.truth, places, of_form);
  add_rows(rows[0], scene.loss, rows[0].unknowns, of_rows);
  EXPECT_NEAR(of_form.robust_cost, of_rows.robust_cost, 1e-9 * of_rows.robust_cost);
  EXPECT_LT((of_form.gradient - of_rows.gradient).norm(), 1e-8 * of_rows.gradient.norm());
  EXPECT_LT((of_form.hessian - of_rows.hessian).norm(), 1e-8 * of_rows.hessian.norm());
  EXPECT_LT((of_form.curvature - of_rows.curvature).norm(), 1e-8 * of_rows.curvature.norm());
}

}  // namespace
}  // namespace palpate::estimation::shared_noise_test
