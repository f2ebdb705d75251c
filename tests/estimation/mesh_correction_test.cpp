// label: unit
// SPDX-License-Identifier: Apache-2.0
// A fit on a coarse mesh that is corrected by a finer one ends where a fit on the finer one does.
#include "palpate/estimation/mesh_correction.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pushed_block.hpp"

namespace palpate::estimation::mesh_correction_test {
namespace {

class MeshCorrections : public testing::Test {
 protected:
  void SetUp() override {
    recording.rest.volume = kuhn_block(4, 3, 2, block_size_m);
    truth.sigma_m = 1e-4;
    truth.points = 400;
    truth.finer = 3;
    inputs = clouds_of(truth, recording);
    finer = finer_model(recording, coarse);
    ASSERT_TRUE(finer);
  }
  Recording recording = pushed_block_recording();
  SimulatedObject coarse = coarse_block();
  PushedBlock truth;
  Inputs inputs;
  std::optional<FinerModel> finer;
};

TEST_F(MeshCorrections, MakePredictionsThoseOfTheFinerMesh) {
  Unknowns here, there;
  ForwardModel model(recording, coarse, here, tight());
  ForwardModel fine(finer->recording, finer->object, there, tight());
  ASSERT_EQ(here.size(), there.size());
  VectorX at = here.prior_mean();
  at(log_young) = std::log(2e4);
  at(poisson) = 0.3;
  const StepPrediction plain = model.predict(1, at);
  fine.start_from(model);
  const StepPrediction wanted = fine.predict(1, at);
  EXPECT_FALSE(change_between(plain, StepPrediction{}, at)) << "no equilibrium";
  model.set_changes({std::nullopt, change_between(plain, wanted, at)});
  ASSERT_TRUE(model.changes()[1]);

  const StepPrediction corrected = model.predict(1, at);
  const double apart_m = (plain.surface_m - wanted.surface_m).cwiseAbs().maxCoeff();
  ASSERT_GT(apart_m, 5e-5);
  EXPECT_LT((corrected.surface_m - wanted.surface_m).cwiseAbs().maxCoeff(), 1e-8 * apart_m);
  EXPECT_LT((corrected.travel_m - wanted.travel_m).cwiseAbs().maxCoeff(), 1e-8 * apart_m);
  EXPECT_LT((corrected.d_surface - wanted.d_surface).cwiseAbs().maxCoeff(), 1e-6 * wanted.d_surface.cwiseAbs().maxCoeff());
  EXPECT_LT((corrected.d_travel - wanted.d_travel).cwiseAbs().maxCoeff(), 1e-6 * wanted.d_travel.cwiseAbs().maxCoeff());

  // Away from there the rest is of second order.
  VectorX away = at;
  away(log_young) += 0.1;
  away(poisson) -= 0.03;
  const StepPrediction moved = model.predict(1, away), moved_fine = fine.predict(1, away);
  const double further_m = (moved_fine.surface_m - wanted.surface_m).cwiseAbs().maxCoeff();
  ASSERT_GT(further_m, apart_m) << "what was gone is more than what the mesh makes";
  EXPECT_LT((moved.surface_m - moved_fine.surface_m).cwiseAbs().maxCoeff(), 0.05 * apart_m);
}

TEST_F(MeshCorrections, LeadToTheAnswerOfTheFinerMesh) {
  FitOptions options;
  options.cross_checks = options.stresses = false;
  const Identification on_coarse = fit(recording, coarse, inputs, options);
  const Identification on_fine = fit(finer->recording, finer->object, inputs, options);
  const FinerMesh mesh{&*finer, nullptr};
  int asked = 0;
  options.take_finer = [&](const MeshDoubt& doubt) {
    EXPECT_EQ(doubt.young_std.size(), 1u);
    const double mesh_error = std::abs(doubt.shift.log_young), young_std = doubt.young_std[0];
    EXPECT_GT(mesh_error, 0.2 * std::abs(std::log(on_coarse.parameters[0].value / on_fine.parameters[0].value)));
    EXPECT_NEAR(young_std, on_coarse.parameters[0].std / on_coarse.parameters[0].value, 0.1 * young_std);
    return asked++ == 0 ? &mesh : nullptr;
  };
  const Identification corrected = fit(recording, coarse, inputs, options, {}, &*finer);
  EXPECT_EQ(asked, 1) << "of the mesh that was taken no finer one is known";
  EXPECT_EQ(corrected.termination, Termination::converged);
  for (int k : {0, 1}) {
    const Parameter &wanted = on_fine.parameters[std::size_t(k)], &found = corrected.parameters[std::size_t(k)];
    const double apart = std::abs(on_coarse.parameters[std::size_t(k)].value - wanted.value);
    EXPECT_LT(std::abs(found.value - wanted.value), 0.1 * apart + 0.01 * wanted.std) << wanted.name;
    EXPECT_NEAR(found.std, wanted.std, k == 0 ? 5e-4 * wanted.value : 0.02 * wanted.std) << wanted.name;
  }
  EXPECT_GT(std::abs(std::log(on_coarse.parameters[0].value / on_fine.parameters[0].value)), 0.01) << "the mesh matters";
  EXPECT_NEAR(corrected.fit.chi2_per_dof, on_fine.fit.chi2_per_dof, 0.01 * on_fine.fit.chi2_per_dof);
}

}  // namespace
}  // namespace palpate::estimation::mesh_correction_test
