// label: unit
// SPDX-License-Identifier: Apache-2.0
// Two blocks that look alike from above, one thinner than the other: which one was bent is for the pushes to say, what the other would
// have done to E is in the interval as far as it agrees, and a shape that only fits if the tool never travelled was not pushed.
#include "palpate/estimation/shape_error.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pushed_block.hpp"

namespace palpate::estimation::shape_error_test {
namespace {

/// The block, as deep as its underside is said to be.
SimulatedObject block_from(double underside_m) {
  TetMesh mesh = kuhn_block(4, 3, 2, block_size_m);
  const double depth = 1 - underside_m / block_size_m.z();
  mesh.nodes_m.col(2) = (underside_m + depth * mesh.nodes_m.col(2).array()).matrix();
  return simulated(fem::to_quadratic(mesh), "linear");
}

/// Bent by its end, seen from above.
struct Seen {
  Recording recording = pushed_block_recording();
  Inputs inputs;
};

Seen seen(Recording recording = pushed_block_recording()) {
  Seen out{std::move(recording), {}};
  out.recording.model.poisson_fixed = 0.3;
  PushedBlock truth;
  truth.material = "linear";
  truth.points = 4000;
  truth.sigma_m = 2e-4;
  out.inputs = clouds_of(truth, out.recording);
  leave_the_top(out.inputs);
  return out;
}

/// Driven so far, from a contact that is known to 20 um; the force only says how stiff it is.
Seen driven() {
  Recording recording = pushed_block_recording();
  recording.pushes[0].travel_offset_std_m = 2e-5;
  double travel_m = 0;
  for (Step& step : recording.pushes[0].steps) {
    step.loads[0].force_n.reset();
    step.loads[0].travel_m = travel_m += 0.002;
  }
  Seen out = seen(recording);
  for (std::size_t s = 0; s < out.inputs.size(); ++s) {
    Wrench wrench;
    wrench.force_n = Vec3(0, 0, -0.09 * double(s + 1));
    wrench.force_sigma_n = 0.001;
    out.inputs[s].push_back(wrench);
  }
  return out;
}

Identification fit_beside(ShapeDoubt& doubt, const Seen& data, double underside_m) {
  FitOptions options;
  options.cross_checks = options.stresses = false;
  return fit(data.recording, block_from(underside_m), data.inputs, options, {}, nullptr, nullptr, &doubt);
}

ShapeDoubt doubt_of(const Seen& seen, double underside_m, bool as_likely) {
  ShapeDoubt doubt;
  doubt.unseen_share = 0.5;
  doubt.shapes.push_back({seen.recording, block_from(underside_m), as_likely});
  return doubt;
}

double spread(const ShapeEffect& effect) {
  double sum = 0;
  for (const AnswerShift& shift : effect.shifts) sum = std::hypot(sum, shift.log_young);
  return sum;
}

TEST(ShapeError, ThePushesChooseBetweenShapesThatWereAsLikely) {
  const Seen data = seen();
  for (const double fitted_m : {0.0, 0.01}) {
    ShapeDoubt doubt = doubt_of(data, 0.01 - fitted_m, true);
    const auto answer = fit_beside(doubt, data, fitted_m);
    ASSERT_TRUE(doubt.effect);
    EXPECT_EQ(doubt.effect->better.has_value(), fitted_m > 0);
    EXPECT_NEAR(doubt.effect->softest_pa, 2e4, 1e3);  // of the block as it is
    EXPECT_GT(doubt.effect->stiffest_pa, 5e4);        // of the thin one
    // the mean of two values so far apart, from the one that agrees better, and how far they are from it
    const double apart = std::log(doubt.effect->stiffest_pa / doubt.effect->softest_pa), moved = doubt.effect->move.log_young;
    EXPECT_GT(moved, 0);
    EXPECT_LT(moved, 0.2 * apart);  // chi-square tells
    EXPECT_NEAR(std::pow(spread(*doubt.effect), 2), moved * (apart - moved), 1e-6);
    if (fitted_m == 0) {
      EXPECT_LT(parameter(answer, "young_modulus").lower_95, 2e4);
      EXPECT_GT(parameter(answer, "young_modulus").upper_95, 2e4);
    }
  }
}

TEST(ShapeError, WhatOtherShapesTookIsInTheFitsCount) {
  const Seen data = seen();
  ShapeDoubt none, one = doubt_of(data, 0.01, false), same = one;
  same.shapes.push_back(same.shapes.front());
  const FitSummary alone = fit_beside(none, data, 0).fit, with_one = fit_beside(one, data, 0).fit, with_two = fit_beside(same, data, 0).fit;
  // The fitted shape and the other one were solved for anew, all on meshes of one kind: a third costs half of what these did.
  EXPECT_GT(with_one.solves, alone.solves);
  EXPECT_GT(with_one.load_cases, alone.load_cases);
  EXPECT_EQ(2 * (with_two.load_cases - with_one.load_cases), with_one.load_cases - alone.load_cases);
}

TEST(ShapeError, AShapeThatIsLessLikelyBeforehandCountsLess) {
  const Seen data = seen();
  for (const bool right : {true, false}) {  // is the one that was fitted
    ShapeDoubt doubt = doubt_of(data, right ? 0.01 : 0, false);
    fit_beside(doubt, data, right ? 0 : 0.01);
    ASSERT_TRUE(doubt.effect);
    EXPECT_FALSE(doubt.effect->better) << "it does not take the other's place";
    const double apart = std::log(doubt.effect->stiffest_pa / doubt.effect->softest_pa), counts = std::abs(doubt.effect->move.log_young) / apart;
    EXPECT_GT(counts, 0);
    if (right) EXPECT_LT(counts, 0.3 / 1.3);
    else EXPECT_NEAR(counts, 0.3 / 1.3, 1e-9) << "however much better it agrees";
  }
}

TEST(ShapeError, AShapeThatContradictsTheTravelIsRuledOut) {
  const Seen data = driven();
  ShapeDoubt doubt = doubt_of(data, 0.01, false);
  fit_beside(doubt, data, 0);
  ASSERT_TRUE(doubt.effect);
  EXPECT_EQ(doubt.effect->move.log_young, 0);
  EXPECT_EQ(spread(*doubt.effect), 0);
  EXPECT_EQ(doubt.effect->softest_pa, doubt.effect->stiffest_pa);
  // unless the fitted one does too
  ShapeDoubt other = doubt_of(data, 0.0105, false);
  fit_beside(other, data, 0.01);
  ASSERT_TRUE(other.effect);
  EXPECT_GT(other.effect->move.log_young, 0.001);
}

}  // namespace
}  // namespace palpate::estimation::shape_error_test
