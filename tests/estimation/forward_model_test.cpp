// label: contract
// SPDX-License-Identifier: Apache-2.0
// From unknowns to predictions: derivatives against differences, a bar between platens against its closed form, and what
// cannot be answered.
#include "palpate/estimation/forward_model.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "scenes.hpp"

namespace palpate::estimation::forward_model_test {
namespace {

class Derivatives : public testing::TestWithParam<std::tuple<const char*, std::size_t, bool, bool>> {};

TEST_P(Derivatives, AreThoseOfSurfaceForceAndTravel) {
  const auto& [material, step, weight, regions] = GetParam();
  const TetMesh mesh = kuhn_block(3, 2, 2, block_size_m);
  const Recording recording = clamped_block(mesh, weight);
  Unknowns unknowns;
  SimulatedObject object = simulated(mesh, material);
  if (regions) put_three_regions(object);
  ForwardModel model(recording, object, unknowns, tight());
  ASSERT_EQ(unknowns.ratio_count(), regions ? 2 : 0);
  const VectorX at = away_from_rest(unknowns);
  const StepPrediction here = model.predict(step, at);
  ASSERT_TRUE(here.converged) << here.reason;
  const Index loads = here.travel_m.size();

  // Everything that is predicted, in one column.
  const auto flat = [](const StepPrediction& p) {
    VectorX all(p.surface_m.size() + 4 * p.travel_m.size());
    for (Index v = 0; v < p.surface_m.rows(); ++v) all.segment<3>(3 * v) = p.surface_m.row(v).transpose();
    for (Index l = 0; l < p.travel_m.size(); ++l) {
      all(p.surface_m.size() + 4 * l) = p.travel_m(l);
      all.segment<3>(p.surface_m.size() + 4 * l + 1) = p.force_n[static_cast<std::size_t>(l)];
    }
    return all;
  };
  const StepPrediction plain = model.predict(step, at, false);
  ASSERT_EQ(plain.columns.size(), 0u);
  EXPECT_LT((flat(plain) - flat(here)).norm(), 1e-9 * flat(here).norm()) << "the same without derivatives";
  for (int k = 0; k < unknowns.size(); ++k) {
    VectorX claimed = VectorX::Zero(flat(here).size());
    for (std::size_t c = 0; c < here.columns.size(); ++c) {
      if (here.columns[c] != k) continue;
      const Index column = static_cast<Index>(c);
      claimed.head(here.d_surface.rows()) += here.d_surface.col(column);
      for (Index l = 0; l < loads; ++l) {
        claimed(here.d_surface.rows() + 4 * l) += here.d_travel(l, column);
        claimed.segment<3>(here.d_surface.rows() + 4 * l + 1) += here.d_force[static_cast<std::size_t>(l)].col(column);
      }
    }
    ASSERT_NE(here.field, nullptr);
    if (const int mode = k - here.field_unknown; mode >= 0 && mode < here.field->modes()) {
      for (Index v = 0; v < here.surface_m.rows(); ++v) {
        claimed.segment<3>(3 * v) += here.field->basis()(v, mode) * here.field_directions.row(v).transpose();
      }
    }
    const double h = difference_of(unknowns, k);
    VectorX ahead = at, behind = at;
    ahead(k) += h;
    behind(k) -= h;
    const VectorX measured = (flat(model.predict(step, ahead)) - flat(model.predict(step, behind))) / (2 * h);
    const auto compare = [&](Index first, Index size, double matters, const char* what) {
      const double scale = std::max(measured.segment(first, size).cwiseAbs().maxCoeff(), matters);
      EXPECT_LT((claimed - measured).segment(first, size).cwiseAbs().maxCoeff(), 2e-5 * scale)
          << what << " to " << unknowns[k].name;
    };
    const double per_unknown = k <= poisson ? 1 : unknowns[k].prior_std;
    compare(0, here.d_surface.rows(), 1e-7 / per_unknown, "surface");  // metres that matter
    for (Index l = 0; l < loads; ++l) {
      compare(here.d_surface.rows() + 4 * l, 1, 1e-7 / per_unknown, "travel");
      compare(here.d_surface.rows() + 4 * l + 1, 3, 1e-4 / per_unknown, "force");  // newton that matter
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Clamped, Derivatives,
                         testing::Combine(testing::Values("neo_hookean", "linear"), testing::Values(0, 1, 2, 3),
                                          testing::Bool(), testing::Bool()));

/// A bar that lies on z = 0 without friction, under a platen without friction at its top.
Recording bar_under_platen(const Vec3& size_m, double travel_m) {
  Recording recording;
  recording.supports = {sliding("table", Vec3::Zero(), Vec3::UnitZ())};
  Tool plate;
  plate.name = "plate";
  plate.shape = ToolShape::platen;
  plate.plane = {Vec3(0, 0, size_m.z()), -Vec3::UnitZ()};
  plate.contact = ContactLaw::frictionless;
  recording.tools = {plate};
  Load load;
  load.tool = "plate";
  load.travel_m = travel_m;
  Push push;
  push.name = "press";
  push.steps.resize(1);
  push.steps[0].loads = {load};
  recording.pushes = {push};
  return recording;
}

TEST(ForwardModel, BarBetweenSmoothPlatensIsTheClosedForm) {
  const Vec3 size_m(0.03, 0.02, 0.05);
  const double young_pa = 12345, nu = 0.31, travel_m = 0.004;
  const TetMesh mesh = kuhn_block(2, 1, 2, size_m);
  const Recording recording = bar_under_platen(size_m, travel_m);
  Unknowns unknowns;
  ForwardModel model(recording, simulated(mesh, "linear"), unknowns);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(young_pa);
  at(poisson) = nu;
  const StepPrediction predicted = model.predict(0, at);
  ASSERT_TRUE(predicted.converged) << predicted.reason;

  // F = E A travel / h on the object, along the push; sides bulge by nu times the strain; dF / dlogE = F.
  const double area_m2 = size_m.x() * size_m.y();
  const Vec3 force_n(0, 0, -young_pa * area_m2 * travel_m / size_m.z());
  EXPECT_LT((predicted.force_n[0] - force_n).norm(), 1e-9 * force_n.norm());
  EXPECT_LT((predicted.d_force[0].col(log_young) - force_n).norm(), 1e-8 * force_n.norm());
  EXPECT_LT(predicted.d_force[0].col(poisson).norm(), 1e-8 * force_n.norm());
  EXPECT_NEAR(predicted.travel_m(0), travel_m, 1e-15);
  // The bar may turn on the table, so its stretches are read along its own edges (the linear law's strain ignores small
  // turns).
  const double strain = travel_m / size_m.z();
  const Points& rest_m = model.object().surface.rest().vertices_m;
  const Vec3 stretch(1 + nu * strain, 1 + nu * strain, 1 - strain);
  for (Index a = 0; a < rest_m.rows(); ++a) {
    for (Index b = 0; b < a; ++b) {
      const Vec3 before = (rest_m.row(a) - rest_m.row(b)).transpose();
      const Vec3 after = (predicted.surface_m.row(a) - predicted.surface_m.row(b)).transpose();
      ASSERT_NEAR(before.dot(after), before.dot(stretch.cwiseProduct(before)), 1e-9 * before.squaredNorm());
    }
  }
}

TEST(ForwardModel, LoadOnAMotionThatSupportsLeaveFreeIsAnError) {
  const Vec3 size_m(0.03, 0.02, 0.05);
  const TetMesh mesh = kuhn_block(2, 1, 2, size_m);
  Recording recording = bar_under_platen(size_m, 0.001);
  Tool finger;
  finger.name = "finger";
  finger.shape = ToolShape::vertices;
  finger.vertices = nodes_where(mesh, [&](const Vec3& x) { return x.x() > size_m.x() - 1e-9; });
  recording.tools.push_back(finger);
  Load sideways;
  sideways.tool = "finger";
  sideways.force_n = Vec3(-0.1, 0, 0);
  recording.pushes[0].steps[0].loads.push_back(sideways);
  recording.pushes[0].steps[0].source = "recording.yaml:17";

  Unknowns unknowns;
  ForwardModel model(recording, simulated(mesh, "linear"), unknowns);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(1e4);
  at(poisson) = 0.3;
  try {
    model.predict(0, at);
    FAIL() << "a bar that can slide was pushed sideways";
  } catch (const Error& error) {
    EXPECT_EQ(error.where(), "recording.yaml:17");
    EXPECT_NE(error.message().find("free to slide"), std::string::npos) << error.what();
  }

  // Held sideways, the same push has an answer.
  recording.supports.push_back(sliding("wall", Vec3::Zero(), Vec3::UnitX()));
  Unknowns again;
  ForwardModel held(recording, simulated(mesh, "linear"), again);
  EXPECT_TRUE(held.predict(0, at).converged);
}

TEST(ForwardModel, UnknownToolAndImposedMotionOfATipAreErrors) {
  const Vec3 size_m(0.03, 0.02, 0.05);
  const TetMesh mesh = kuhn_block(1, 1, 1, size_m);
  Recording recording = bar_under_platen(size_m, 0.001);
  recording.tools[0].shape = ToolShape::sphere;
  Unknowns unknowns;
  EXPECT_THROW(ForwardModel(recording, simulated(mesh, "linear"), unknowns), Error);

  Recording nameless = bar_under_platen(size_m, 0.001);
  nameless.pushes[0].steps[0].loads[0] = {};
  nameless.pushes[0].steps[0].loads[0].tool = "hand";
  nameless.pushes[0].steps[0].loads[0].force_n = Vec3(0, 0, -1);
  Unknowns others;
  EXPECT_THROW(ForwardModel(nameless, simulated(mesh, "linear"), others), Error);
}

TEST(ForwardModel, WarmAndColdStartsAgree) {
  const TetMesh mesh = kuhn_block(3, 2, 2, block_size_m);
  const Recording recording = clamped_block(mesh);
  Unknowns unknowns;
  ForwardModel model(recording, simulated(mesh, "neo_hookean"), unknowns, tight());
  const VectorX at = away_from_rest(unknowns);
  VectorX elsewhere = at;
  elsewhere(log_young) += 0.8;
  elsewhere(poisson) = 0.45;
  model.predict(0, elsewhere);
  const Points warm = model.predict(0, at).surface_m;
  model.forget();
  const Points cold = model.predict(0, at).surface_m;
  EXPECT_LT((warm - cold).cwiseAbs().maxCoeff(), 1e-11);
  const StepPrediction plain = model.predict(0, at, false);
  EXPECT_LT((plain.surface_m - cold).cwiseAbs().maxCoeff(), 1e-11);
}

// A step that is followed along its derivatives is as far from a solution as the model says, and none that is too far is.
TEST(ForwardModel, FollowedStepsAreAsWrongAsTheySay) {
  const TetMesh mesh = kuhn_block(3, 2, 2, block_size_m);
  const Recording recording = clamped_block(mesh);
  Unknowns unknowns;
  ForwardModel model(recording, simulated(mesh, "neo_hookean"), unknowns, tight());
  const VectorX at = away_from_rest(unknowns);
  const auto all_steps = [&](const VectorX& there) {
    std::vector<StepPrediction> steps;
    for (std::size_t s = 0; s < model.step_count(); ++s) steps.push_back(model.predict(s, there));
    return steps;
  };
  const auto anchors = all_steps(at);
  EXPECT_EQ(model.reuse_error(), 0);
  double before = 0;
  for (const double change : {0.002, 0.02, 0.1}) {
    VectorX there = at;
    there(log_young) += change;
    there(poisson) += 0.3 * change;
    all_steps(at);
    model.set_reuse(0.05);
    const int solves = model.solves();
    const auto followed = all_steps(there);
    const double error = model.reuse_error();
    const bool solved = model.solves() > solves;
    model.set_reuse(0);
    EXPECT_EQ(solved, change > 0.05) << change;
    if (solved) continue;
    EXPECT_GT(error, before);
    before = error;
    const auto truth = all_steps(there);
    for (std::size_t s = 0; s < truth.size(); ++s) {
      ASSERT_TRUE(truth[s].converged) << truth[s].reason;
      ASSERT_TRUE(followed[s].converged);
      const double moved_m = (truth[s].surface_m - model.object().surface.rest().vertices_m).cwiseAbs().maxCoeff();
      EXPECT_LT((followed[s].surface_m - truth[s].surface_m).cwiseAbs().maxCoeff(), 3 * error * moved_m) << s << " at " << change;
      if (truth[s].travel_m.size() == 0) continue;
      EXPECT_LT((followed[s].travel_m - truth[s].travel_m).cwiseAbs().maxCoeff(), 3 * error * moved_m) << s << " at " << change;
    }
  }
}

}  // namespace
}  // namespace palpate::estimation::forward_model_test
