// label: unit
// SPDX-License-Identifier: Apache-2.0
// A block held at one end and seen from above, whose underside is not where it was put: what was seen stays, what was not may lean
// away, E moves to where the pushes have it, and the interval holds what they do not say.
#include "palpate/estimation/unseen_modes.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/estimation/shape_error.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::unseen_modes_test {
namespace {

constexpr double true_pa = 2e4;

SimulatedObject block_from(double underside_m) {
  TetMesh mesh = kuhn_block(6, 3, 2, block_size_m);
  const double depth = 1 - underside_m / block_size_m.z();
  mesh.nodes_m.col(2) = (underside_m + depth * mesh.nodes_m.col(2).array()).matrix();
  return simulated(fem::to_quadratic(mesh), "linear");
}

/// Held at x = 0, seen from above.
UnseenSide underside(const SimulatedObject& block) {
  UnseenSide side;
  side.up = Vec3::UnitX();
  side.toward = Vec3::UnitZ();
  const TriMesh surface = block.surface.rest();
  side.seen.vertices_m = surface.vertices_m;
  std::vector<Index> top;
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    bool above = true;
    for (int k = 0; k < 3; ++k) above = above && surface.vertices_m(surface.triangles(t, k), 2) > 0.999 * block_size_m.z();
    if (above) top.push_back(t);
  }
  side.seen.triangles = surface.triangles(top, Eigen::all);
  return side;
}

struct Seen {
  Recording recording = pushed_block_recording();
  Inputs inputs;
};

Seen seen_from_above(double sigma_m) {
  Seen out;
  out.recording.model.poisson_fixed = 0.3;
  PushedBlock truth;
  truth.material = "linear";
  truth.points = 4000;
  truth.sigma_m = sigma_m;
  out.inputs = clouds_of(truth, out.recording);
  leave_the_top(out.inputs);
  return out;
}

FitOptions quick() {
  FitOptions options;
  options.cross_checks = options.stresses = false;
  return options;
}

/// Beside the block as it is, a shape that changes nothing: what is in the interval is of the leans alone.
ShapeDoubt doubt_of(const Recording& recording, const SimulatedObject& block) {
  ShapeDoubt doubt;
  doubt.unseen_share = 0.5;
  doubt.side = underside(block);
  doubt.shapes.push_back({recording, block, false, 1, doubt.side});
  return doubt;
}

TEST(UnseenModes, LeaveWhatWasSeenAndStayAlongTheSupport) {
  const SimulatedObject block = block_from(0);
  const UnseenSide side = underside(block);
  for (int m = 0; m < unseen_mode_count; ++m) {
    VectorX amounts = VectorX::Unit(unseen_mode_count, m);
    const Points motion = with_unseen_moved(block.mesh, side, amounts).nodes_m - block.mesh.nodes_m;
    EXPECT_EQ(amounts, VectorX(VectorX::Unit(unseen_mode_count, m)));
    double most_m = 0;
    for (Index i = 0; i < motion.rows(); ++i) {
      const double depth_m = block_size_m.z() - block.mesh.nodes_m(i, 2);
      EXPECT_LT(std::abs(motion(i, 0)), 1e-15);
      EXPECT_LT(motion.row(i).norm(), unseen_lean_std * depth_m + 1e-12);
      most_m = std::max(most_m, motion.row(i).norm());
    }
    EXPECT_NEAR(most_m, unseen_lean_std * block_size_m.z(), 1e-12) << m;
  }
}

TEST(UnseenModes, ATouchedPlaceIsKnown) {
  const SimulatedObject block = block_from(0);
  UnseenSide side = underside(block);
  side.touched_m = {Vec3(0.5 * block_size_m.x(), 0.5 * block_size_m.y(), 0)};
  VectorX amounts = VectorX::Unit(unseen_mode_count, 0);
  const Points motion = with_unseen_moved(block.mesh, side, amounts).nodes_m - block.mesh.nodes_m;
  for (const Index i : block.mesh.tetrahedra.leftCols(4).reshaped())
    EXPECT_LE(motion.row(i).norm(), unseen_lean_std * (Vec3(block.mesh.nodes_m.row(i)) - side.touched_m[0]).norm() + 1e-12);
}

TEST(UnseenModes, NoElementTurnsInsideOutAndEdgesStayStraight) {
  const SimulatedObject block = block_from(0);
  VectorX amounts = 5 * VectorX::Unit(unseen_mode_count, 0);
  amounts(0) = -5;  // the underside above the top
  const TetMesh moved = with_unseen_moved(block.mesh, underside(block), amounts);
  EXPECT_GT(amounts(0), -4);
  EXPECT_LT(amounts(0), 0);
  for (Index t = 0; t < moved.tetrahedra.rows(); ++t) {
    const auto node = [&](int k) { return Vec3(moved.nodes_m.row(moved.tetrahedra(t, k))); };
    EXPECT_GT((node(1) - node(0)).cross(node(2) - node(0)).dot(node(3) - node(0)), 0);
    EXPECT_LT((node(4) - 0.5 * (node(0) + node(1))).norm(), 1e-12);
    EXPECT_LT((node(9) - 0.5 * (node(2) + node(3))).norm(), 1e-12);
  }
}

TEST(UnseenModes, TheIntervalHoldsTheTruthWhereTheUndersideIsWrong) {
  const Seen data = seen_from_above(6e-4);
  for (const double underside_m : {-0.002, 0.002}) {
    const SimulatedObject block = block_from(underside_m);
    const auto without = fit(data.recording, block, data.inputs, quick());
    const auto& certain = parameter(without, "young_modulus");
    EXPECT_TRUE(certain.upper_95 < true_pa || certain.lower_95 > true_pa);
    ShapeDoubt doubt = doubt_of(data.recording, block);
    const auto with = fit(data.recording, block, data.inputs, quick(), {}, nullptr, nullptr, &doubt);
    const auto& young = parameter(with, "young_modulus");
    ASSERT_TRUE(doubt.effect);
    EXPECT_LT(young.lower_95, true_pa);
    EXPECT_GT(young.upper_95, true_pa);
  }
}

TEST(UnseenModes, AMillimetreDoesWhatAFitWithThatMillimetreSays) {
  const Seen data = seen_from_above(2e-3);
  const SimulatedObject block = block_from(0);
  ShapeDoubt doubt = doubt_of(data.recording, block);
  fit(data.recording, block, data.inputs, quick(), {}, nullptr, nullptr, &doubt);
  ASSERT_TRUE(doubt.effect);
  constexpr double little = 0.1;
  double leaning = 0;
  for (const int mode : {0, unseen_mode_count - 1}) {  // away, and all around outwards: both make it thicker
    double log_young[2];
    for (const int sign : {-1, 1}) {
      SimulatedObject leant = block;
      VectorX amounts = sign * little * VectorX::Unit(unseen_mode_count, mode);
      leant.mesh = with_unseen_moved(block.mesh, underside(block), amounts);
      log_young[sign > 0] = std::log(parameter(fit(data.recording, leant, data.inputs, quick()), "young_modulus").value);
    }
    const double per_deviation = (log_young[1] - log_young[0]) / (2 * little);
    EXPECT_LT(per_deviation, -0.3) << mode;  // thicker, so less E will do
    leaning = std::hypot(leaning, per_deviation);
  }
  double leans = 0;
  for (const AnswerShift& shift : doubt.effect->shifts) leans = std::hypot(leans, shift.log_young);
  // the pushes say a little of it, and other modes add a little
  EXPECT_NEAR(leans, leaning, 0.3 * leaning);
}

// Nuisances stand one place further on where regions have a nu of their own: with all nu held at one value the modes say the same.
TEST(UnseenModes, RegionsMayHaveANuOfTheirOwn) {
  std::vector<UnseenModes> said;
  for (const bool own : {false, true}) {
    Seen data = seen_from_above(6e-4);
    data.recording.model.poisson_fixed.reset();
    data.recording.model.poisson_by_region = own;
    data.recording.pushes[0].force_tare_std_n = 0.02;
    SimulatedObject block = block_from(0.002);
    put_two_halves(block);
    Unknowns unknowns;
    ForwardModel model(data.recording, block, unknowns);
    Objective objective(model, data.inputs, unknowns);
    Optimum at;
    at.unknowns = unknowns.prior_mean();
    at.unknowns(log_young) = std::log(true_pa);
    for (int k = 0; k < unknowns.parameter_count(); ++k) {
      if (k != poisson && k < unknowns.first_own_poisson()) continue;
      at.unknowns(k) = 0.3;
      unknowns[k].fixed = true;
    }
    at.evaluation = objective.evaluate(at.unknowns, at.loss);
    ASSERT_TRUE(at.evaluation.usable);
    const auto modes =
        unseen_modes(underside(block), VectorX::Zero(unseen_mode_count), data.recording, block, objective, at, at.loss, 1, {}, nullptr);
    ASSERT_TRUE(modes);
    said.push_back(*modes);
  }
  EXPECT_GT(said[0].gain, 1);
  EXPECT_NEAR(said[1].gain, said[0].gain, 1e-6 * said[0].gain);
  EXPECT_LT((said[1].amounts - said[0].amounts).norm(), 1e-6 * said[0].amounts.norm());
  EXPECT_NEAR(said[1].change(log_young), said[0].change(log_young), 1e-6 * std::abs(said[0].change(log_young)));
}

// At a bound that the data push it out of nu is as good as known: the modes do what they do where it is.
TEST(UnseenModes, ANuThatIsHeldAtItsBoundDoesNotTakeEAlong) {
  std::vector<UnseenModes> said;
  for (const bool known : {false, true}) {
    Seen data = seen_from_above(3e-4);
    data.recording.model.poisson_fixed.reset();
    data.recording.model.poisson_upper = 0.1;  // of 0.3
    const SimulatedObject block = block_from(0);
    Unknowns unknowns;
    ForwardModel model(data.recording, block, unknowns);
    Objective objective(model, data.inputs, unknowns);
    VectorX start = unknowns.prior_mean();
    start(log_young) = std::log(true_pa);
    start(poisson) = 0.1;
    unknowns[poisson].fixed = known;
    const Optimum at = optimise(objective, start, {}, {}, {});
    ASSERT_EQ(at.termination, Termination::converged) << at.message;
    ASSERT_EQ(at.unknowns(poisson), 0.1);
    const auto modes =
        unseen_modes(underside(block), VectorX::Zero(unseen_mode_count), data.recording, block, objective, at, at.loss, 1, {}, nullptr);
    ASSERT_TRUE(modes);
    said.push_back(*modes);
  }
  EXPECT_EQ(said[0].change(poisson), 0);
  EXPECT_NEAR(said[0].gain, said[1].gain, 1e-3 * said[1].gain);
  EXPECT_NEAR(said[0].change(log_young), said[1].change(log_young), 1e-3 * std::abs(said[1].change(log_young)));
  EXPECT_LT((said[0].amounts - said[1].amounts).norm(), 1e-3 * said[1].amounts.norm());
}

}  // namespace
}  // namespace palpate::estimation::unseen_modes_test
