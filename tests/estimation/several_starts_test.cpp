// label: unit
// SPDX-License-Identifier: Apache-2.0
// What is said of a search from several starts: how many there were, where they ended, and whether the data tell these places apart.
#include "palpate/estimation/several_starts.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/estimation/verdicts.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::several_starts_test {
namespace {

Starts two(double difference, double scale = 1) {
  return {3, {{std::log(1e4), 0.3, 100}, {std::log(4e4), 0.1, 100 + difference}}, scale};
}

TEST(SeveralMinima, AreSaidWhereNoiseCouldSwapThem) {
  // Twice the difference is a chi-square of two degrees of freedom: 5.99 at 95 %.
  EXPECT_TRUE(several_minima(two(2.9)));
  EXPECT_FALSE(several_minima(two(3.1)));
  // Residuals twice as large as stated make costs scatter four times as much.
  EXPECT_TRUE(several_minima(two(11.9, 2)));
  EXPECT_FALSE(several_minima(two(12.1, 2)));
  Starts one = two(0);
  one.minima.resize(1);
  EXPECT_FALSE(several_minima(one));
  EXPECT_FALSE(several_minima({}));
  const std::string said = several_minima(two(1))->message;
  EXPECT_NE(said.find("10.0 kPa"), std::string::npos) << said;
  EXPECT_NE(said.find("40.0 kPa"), std::string::npos) << said;
}

TEST(SeveralMinima, OfOneValleyAreOne) {
  const std::vector<Minimum> found{{1.3, 0.30, 12}, {1.0, 0.30, 10}, {1.05, 0.31, 10.5}, {1.0, 0.45, 11}};
  const auto sharp = distinct_minima(found, 0.01, 0.01, 1);
  ASSERT_EQ(sharp.size(), 4u);
  EXPECT_EQ(sharp.front().cost, 10);  // sorted
  EXPECT_EQ(distinct_minima(found, 0.04, 0.01, 1).size(), 3u);
  EXPECT_EQ(distinct_minima(found, 0.2, 0.1, 1).size(), 1u);
  EXPECT_EQ(distinct_minima(found, 0.1, 0.05, 2).size(), 1u);  // noise is twice what is stated
}

Identification fitted(const Recording& recording, const SimulatedObject& object, const Inputs& inputs, const FitOptions& options) {
  return fit(recording, object, inputs, options);
}

TEST(SeveralStarts, OneIsEnoughWhereItFits) {
  FitOptions options;
  options.cross_checks = options.stresses = false;
  const Identification answer = fitted(pushed_block_recording(), coarse_block(), clouds_of({}), options);
  const std::string said = answer.provenance.at("starts of the search");
  EXPECT_EQ(said.substr(0, 11), "1; minimum:") << said;
  EXPECT_FALSE(says(answer, "several_minima"));
}

TEST(SeveralStarts, ThreeThatEndInOnePlaceAreSaidSo) {
  PushedBlock truth;  // in a clamp that stands elsewhere, so that nothing fits
  truth.clamp.translation_m = Vec3(0.001, -0.002, 0.004);
  truth.clamp.rotation_rad = Vec3(0.02, 0.06, -0.03);
  FitOptions options;
  options.cross_checks = options.stresses = false;
  const Identification answer = fitted(pushed_block_recording(), coarse_block(), clouds_of(truth), options);
  const std::string said = answer.provenance.at("starts of the search");
  EXPECT_EQ(said.substr(0, 2), "3 ") << said;
  EXPECT_NE(said.find("minimum:"), std::string::npos) << said;
}

/// What a search from three starts asks for, and where it was stopped.
struct Search {
  Recording recording = pushed_block_recording();
  Unknowns unknowns;
  std::unique_ptr<ForwardModel> model;
  std::unique_ptr<Objective> objective;

  Search(const std::string& material, const Inputs& inputs, const TetMesh& mesh, double force_n, fem::StaticsOptions options = {}) {
    for (Step& step : recording.pushes[0].steps) step.loads[0].force_n = *step.loads[0].force_n * force_n / 0.12;
    model = std::make_unique<ForwardModel>(recording, simulated(mesh, material), unknowns, options);
    objective = std::make_unique<Objective>(*model, inputs, unknowns);
  }
  VectorX start(double young_pa) const {
    VectorX at = unknowns.prior_mean();
    at(log_young) = std::log(young_pa);
    at(poisson) = 0.3;
    return at;
  }
};

/// A clamp that stands elsewhere, so that nothing fits.
PushedBlock elsewhere(const std::string& material) {
  PushedBlock truth;
  truth.clamp.translation_m = Vec3(0.001, -0.002, 0.004);
  truth.clamp.rotation_rad = Vec3(0.02, 0.06, -0.03);
  truth.material = material;
  truth.finer = 1;
  truth.points = 60;
  return truth;
}

TEST(SeveralStarts, ACallerWhoStopsIsToldSoWhereverThatWas) {
  const Inputs inputs = clouds_of(elsewhere("linear"));
  Search search("linear", inputs, kuhn_block(3, 2, 2, block_size_m), 0.12);
  int calls = 0, last = 1 << 30;
  const OnProgress count = [&](std::string_view, double) { return ++calls < last; };
  const auto run = [&] {
    calls = 0;
    search.model->forget();
    return optimise_from_several(*search.objective, search.start(2e4), Loss{}, {}, count);
  };
  const Optimum whole = run();
  ASSERT_EQ(whole.termination, Termination::converged) << whole.message;
  const int all = calls;
  for (last = 1; last <= all; ++last) {
    const Optimum at = run();
    EXPECT_EQ(at.termination, Termination::cancelled) << last << " of " << all << ": " << at.message;
  }
}

/// Few steps of Newton's method lead to the deepest equilibria from a neighbour, as a search comes there, and not from rest.
TEST(SeveralStarts, WhatRestDoesNotLeadToIsNoBetterForIt) {
  constexpr double force_n = 2;
  Recording pressed = pushed_block_recording();
  for (Step& step : pressed.pushes[0].steps) step.loads[0].force_n = *step.loads[0].force_n * force_n / 0.12;
  const Inputs inputs = clouds_of(elsewhere("neo_hookean"), pressed);
  const TetMesh mesh = kuhn_block(3, 2, 2, block_size_m);
  fem::StaticsOptions few;
  few.max_newton_steps = 4;
  few.max_load_steps = 1;
  Search patient("neo_hookean", inputs, mesh, force_n), hasty("neo_hookean", inputs, mesh, force_n, few);
  const Optimum best = optimise_from_several(*patient.objective, patient.start(1e5), Loss{}, {}, {});
  const Optimum same = optimise_from_several(*hasty.objective, hasty.start(1e5), Loss{}, {}, {});
  ASSERT_TRUE(same.evaluation.usable) << same.message << ": " << same.evaluation.reason;
  EXPECT_EQ(same.termination, Termination::converged);
  EXPECT_NEAR(same.unknowns(log_young), best.unknowns(log_young), 0.01);
  hasty.model->forget();
  EXPECT_FALSE(hasty.objective->evaluate(same.unknowns, same.loss).usable) << "the case that is meant";
}

/// A bar whose first quarter is stretched while the rest, with ridges every 8 mm, moves along as one piece; seen is a window of the
/// ridges that is nowhere near their end. Moved by 11 mm under its full load, it looks as if moved by 3 or by 43 mm.
/// @param stated_m  what is said of noise that is 0.6 mm
Identification ridged_bar(const std::vector<double>& shares, double stated_m) {
  const Vec3 bar_m(0.12, 0.02, 0.02);
  constexpr double root_m = 0.03, period_m = 0.008, ridge_m = 0.0015, moved_m = 0.011, young_pa = 2e4, noise_m = 6e-4;
  TetMesh mesh = kuhn_block(120, 2, 2, bar_m);
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i)
    if (mesh.nodes_m(i, 2) > bar_m.z() - 1e-9 && mesh.nodes_m(i, 0) > 0.036)
      mesh.nodes_m(i, 2) += ridge_m * std::sin(2 * EIGEN_PI * mesh.nodes_m(i, 0) / period_m);
  Recording recording;
  Support clamp;
  clamp.name = "clamp";
  clamp.kind = SupportKind::clamp;
  clamp.vertices = nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; });
  recording.supports = {clamp};
  Tool ring;
  ring.name = "ring";
  ring.shape = ToolShape::vertices;
  ring.vertices = nodes_where(mesh, [&](const Vec3& x) { return std::abs(x.x() - root_m) < 1e-9; });
  recording.tools = {ring};
  Push& pull = recording.pushes.emplace_back();
  pull.name = "pull";
  for (const double share : shares) {
    Load load;
    load.tool = "ring";
    load.force_n = Vec3(share * young_pa * bar_m.y() * bar_m.z() * moved_m / root_m, 0, 0);
    load.direction = Vec3::UnitX();
    pull.steps.emplace_back().loads = {load};
  }
  recording.model.poisson_fixed = 0.3;
  const SimulatedObject object = simulated(mesh, "linear");
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(young_pa);
  at(poisson) = 0.3;
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0, noise_m);
  Inputs inputs;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    const Points surface_m = model.predict(s, at, false).surface_m;
    const Points& rest_m = model.object().surface.rest().vertices_m;
    PointCloud cloud;
    cloud.sigma_m = VectorX::Constant(1, stated_m);
    for (Index i = 0; i < surface_m.rows(); ++i) {
      if (rest_m(i, 2) < bar_m.z() - 1.01 * ridge_m || rest_m(i, 0) < 0.08 || rest_m(i, 0) > 0.095) continue;
      cloud.points_m.conservativeResize(cloud.points_m.rows() + 1, 3);
      cloud.points_m.bottomRows<1>() = surface_m.row(i) + Vec3(normal(random), normal(random), normal(random)).transpose();
    }
    inputs.push_back({cloud});
  }
  FitOptions options;
  options.cross_checks = options.stresses = false;
  options.young_start_pa = young_pa;
  return fit(recording, object, inputs, options);
}

std::size_t count(const std::string& text, const std::string& word) {
  std::size_t n = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

TEST(SeveralStarts, RidgesThatLookAlikeAreSeveralMinimaAndThatIsSaid) {
  const Identification answer = ridged_bar({1}, 2e-4);
  const std::string said = answer.provenance.at("starts of the search");
  EXPECT_EQ(said.substr(0, 2), "3 ") << said;
  EXPECT_GE(count(said, " E "), 2u) << said;
  EXPECT_TRUE(says(answer, "several_minima")) << said;
}

TEST(SeveralStarts, ALightLoadTellsThemApart) {
  const Identification answer = ridged_bar({0.1, 0.25, 0.5, 1}, 2e-4);
  const std::string said = answer.provenance.at("starts of the search");
  EXPECT_EQ(said.substr(0, 2), "3 ") << said;  // noise that is three times what is stated does not fit
  EXPECT_FALSE(says(answer, "several_minima")) << said;
  EXPECT_NEAR(parameter(answer, "young_modulus").value, 2e4, 0.1 * 2e4);
}

}  // namespace
}  // namespace palpate::estimation::several_starts_test
