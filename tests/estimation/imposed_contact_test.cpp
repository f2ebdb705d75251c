// label: oracle
// SPDX-License-Identifier: Apache-2.0
// Pushes whose motion is imposed, and what is not exactly known of them: where the tool touches, and the travel of a step.
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/estimation/load_columns.hpp"
#include "palpate/estimation/rigid_tool.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::imposed_contact_test {
namespace {

constexpr double young_pa = 2e4, force_sigma_n = 2e-4;
const Vec3 stated_m(0.045, 0.02, block_size_m.z());

/// The block clamped at x = 0, its free end bent down by a ball that moves: at first it only stands there.
Recording bent_block(ContactLaw law, const Vec3& contact_m = stated_m) {
  Recording recording = pushed_block_recording();
  recording.model.poisson_fixed = 0.3;
  Tool ball;
  ball.name = "ball";
  ball.shape = ToolShape::sphere;
  ball.radius_m = 0.02;
  ball.contact = law;
  recording.tools = {ball};
  Push& push = recording.pushes[0];
  push.steps.clear();
  for (const double travel_m : {0.001, 0.002}) {
    Step step;
    Load load;
    load.tool = "ball";
    load.travel_m = travel_m;
    load.contact_m = contact_m;
    load.direction = -Vec3::UnitZ();
    step.loads = {load};
    push.steps.push_back(step);
  }
  return recording;
}

/// Fine under the ball: what touches is a few points of every face, and as a function of where it touches no smoother than they lie.
SimulatedObject block() { return simulated(kuhn_block(12, 8, 6, block_size_m), "linear"); }

/// What a wrist would read where the ball really touches; of the same mesh, so that the contact alone is wrong.
Inputs wrenches_of(const Recording& real) {
  Unknowns unknowns;
  ForwardModel model(real, block(), unknowns);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(young_pa);
  at(poisson) = 0.3;
  Inputs inputs;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    Wrench read;
    read.force_n = model.predict(s, at, false).force_n[0];
    read.along = -Vec3::UnitZ();
    read.force_sigma_n = force_sigma_n;
    inputs.push_back({read});
  }
  return inputs;
}

Recording with_contact_std(Recording recording, double std_m) {
  for (auto& step : recording.pushes[0].steps) step.loads[0].contact_std_m = std_m;
  return recording;
}

Identification fitted(const Recording& stated, const Inputs& inputs, bool checks = false) {
  FitOptions options;
  options.stresses = false;
  options.cross_checks = checks;
  options.young_start_pa = 1.5e4;
  return fit(stated, block(), inputs, options);
}

bool holds(const Parameter& p, double truth) { return p.lower_95 <= truth && truth <= p.upper_95; }

class ShiftedTool : public testing::TestWithParam<ContactLaw> {};

// On a flat face a shift of the unknown is the same as a contact stated there: nothing is dragged along.
TEST_P(ShiftedTool, IsAToolThatStandsThere) {
  const Vec3 shift_m(-0.003, 0.002, 0);
  Recording stated = with_contact_std(bent_block(GetParam()), 3e-3), there = bent_block(GetParam(), stated_m + shift_m);
  for (Recording* recording : {&stated, &there}) {
    Step unloaded;
    recording->pushes[0].steps.insert(recording->pushes[0].steps.begin(), unloaded);
  }
  Unknowns unknowns, exact;
  ForwardModel model(stated, block(), unknowns, tight()), other(there, block(), exact, tight());
  VectorX at = unknowns.prior_mean(), at_there = exact.prior_mean();
  at(log_young) = at_there(log_young) = std::log(young_pa);
  at(poisson) = at_there(poisson) = 0.3;
  const VectorX as_stated = at;
  const std::vector<int> shift = unknowns.named({"contact_shift[down]_1", "contact_shift[down]_2"});
  ASSERT_EQ(shift.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) at(shift[k]) = tangents(-Vec3::UnitZ())[k].dot(shift_m);
  for (std::size_t s : {1u, 2u}) {
    const StepPrediction by_shift = model.predict(s, at), stands = other.predict(s, at_there);
    ASSERT_TRUE(by_shift.converged && stands.converged) << by_shift.reason << stands.reason;
    EXPECT_LT((by_shift.force_n[0] - stands.force_n[0]).norm(), 2e-3 * stands.force_n[0].norm()) << "step " << s;
    EXPECT_LT((by_shift.surface_m - stands.surface_m).cwiseAbs().maxCoeff(), 2e-5 * static_cast<double>(s)) << "of millimetres";
    // And it matters: as stated the force is another one.
    EXPECT_GT((model.predict(s, as_stated).force_n[0] - stands.force_n[0]).norm(), 0.05 * stands.force_n[0].norm());
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, ShiftedTool, testing::Values(ContactLaw::bonded, ContactLaw::frictionless));

/// A ball that travels at 30 degrees to the normal of a flat face, the block glued below.
Recording slanted_ball(ContactLaw law) {
  Recording recording = bent_block(law, Vec3(0.03, 0.02, block_size_m.z()));
  recording.supports[0].plane = {Vec3::Zero(), Vec3::UnitZ()};
  recording.force_scale_std = 0.02;
  recording.pushes[0].force_tare_std_n = 0.05;
  for (auto& step : recording.pushes[0].steps) step.loads[0].direction = Vec3(0.5, 0, -std::sqrt(0.75));
  return recording;
}

// A sensor of three axes reads all of it: without friction along the face's normal, whichever way the tool goes.
TEST(SlantedTool, PressesAlongTheNormalOfASmoothFace) {
  for (const ContactLaw law : {ContactLaw::frictionless, ContactLaw::bonded}) {
    const Recording recording = slanted_ball(law);
    Unknowns unknowns;
    ForwardModel model(recording, block(), unknowns, tight());
    VectorX at = unknowns.prior_mean();
    at(log_young) = std::log(young_pa);
    at(poisson) = 0.3;
    const StepPrediction here = model.predict(1, at);
    ASSERT_TRUE(here.converged) << here.reason;
    const Vec3 force_n = here.force_n[0];
    const double sideways = std::hypot(force_n.x(), force_n.y()) / force_n.norm();
    if (law == ContactLaw::frictionless) {
      EXPECT_LT(sideways, 0.1);  // a dent leans a little
    } else {
      EXPECT_GT(sideways, 0.15);
    }
    at(unknowns.named({"force_scale"}).at(0)) = 0.01;
    const Vec3 tare_n(0.02, -0.03, 0.04);
    at.segment<3>(unknowns.named({"force_tare[down]_x"}).at(0)) = tare_n;
    const StepPrediction scaled = model.predict(1, at);
    // As of a force that is given: true = (1 + scale) read + tare.
    EXPECT_LT((1.01 * scaled.force_n[0] + tare_n - force_n).norm(), 1e-6 * force_n.norm());
    for (int k = 0; k < unknowns.size(); ++k) {
      const double h = k <= poisson ? 1e-5 : 1e-3 * unknowns[k].prior_std;
      VectorX ahead = at, behind = at;
      ahead(k) += h;
      behind(k) -= h;
      const Vec3 measured = (model.predict(1, ahead, false).force_n[0] - model.predict(1, behind, false).force_n[0]) / (2 * h);
      Vec3 claimed = Vec3::Zero();
      for (std::size_t c = 0; c < scaled.columns.size(); ++c)
        if (scaled.columns[c] == k) claimed += scaled.d_force[0].col(static_cast<Index>(c));
      EXPECT_LT((claimed - measured).norm(), 1e-4 * measured.norm() + 1e-7) << unknowns[k].name;
    }
  }
}

TEST(WayAlongSurface, FollowsTheSurfaceThatItStandsOn) {
  // A face that falls by one in two along x: half a millimetre lower a millimetre on.
  TetMesh wedge = kuhn_block(4, 2, 2, block_size_m);
  for (Index i = 0; i < wedge.nodes_m.rows(); ++i) wedge.nodes_m(i, 2) *= 1 - 0.5 * wedge.nodes_m(i, 0) / block_size_m.z();
  Tool ball = bent_block(ContactLaw::bonded).tools[0];
  ball.radius_m = 0.005;
  Load load;
  load.tool = "ball";
  load.travel_m = 0.0;
  load.contact_m = Vec3(0.03, 0.02, 0.015);
  load.direction = -Vec3::UnitZ();
  EXPECT_LT((way_along_surface(wedge, ball, load, Vec3::UnitX()) - Vec3(1, 0, -0.5)).norm(), 0.02);
  EXPECT_LT((way_along_surface(wedge, ball, load, Vec3::UnitY()) - Vec3::UnitY()).norm(), 0.02);
}

// The ball really touches 3 mm further in, where the bar is stiffer.
TEST(ImposedContact, ThreeMillimetresAsideAreInTheInterval) {
  const double off_m = 3e-3;
  // Of one step: how forces grow from step to step tells a little of where the ball is.
  const auto one_step = [](double x_m) {
    Recording recording = bent_block(ContactLaw::bonded, stated_m + Vec3(x_m, 0, 0));
    recording.pushes[0].steps.erase(recording.pushes[0].steps.begin());
    return recording;
  };
  const Inputs inputs = wrenches_of(one_step(-off_m));
  const Recording exact = one_step(0);
  const Identification trusting = fitted(exact, inputs), open = fitted(with_contact_std(exact, off_m), inputs);
  const Parameter &narrow = parameter(trusting, "young_modulus"), &wide = parameter(open, "young_modulus");
  EXPECT_FALSE(holds(narrow, young_pa)) << narrow.lower_95 << " to " << narrow.upper_95;
  EXPECT_GT(narrow.value, 1.05 * young_pa) << "where it is stiffer it was pushed";
  EXPECT_TRUE(holds(wide, young_pa)) << wide.lower_95 << " to " << wide.upper_95;
  // Three times as wide as fits of the same forces with the contact stated a millimetre to either side are apart.
  const auto young_at = [&](double x_m) { return parameter(fitted(one_step(x_m), inputs), "young_modulus").value; };
  const double half_apart = 1.5 * std::log(young_at(1e-3) / young_at(-1e-3));
  EXPECT_NEAR(wide.std / wide.value, std::abs(half_apart), 0.2 * std::abs(half_apart));
  const auto shift = std::find_if(open.budget.begin(), open.budget.end(), [](const auto& e) { return e.input == "contact_shift"; });
  ASSERT_NE(shift, open.budget.end());
  EXPECT_NEAR(shift->young_modulus_percent, 100 * wide.std / wide.value, 10 * wide.std / wide.value);
  RecordProperty("exact", std::to_string(narrow.lower_95) + " to " + std::to_string(narrow.upper_95));
  RecordProperty("with_contact_std", std::to_string(wide.lower_95) + " to " + std::to_string(wide.upper_95));
}

// Stated as exact it is in no interval, and the budget says so: a third of the above.
TEST(ImposedContact, IsSaidOfWhereItIsStatedAsExact) {
  const Inputs inputs = wrenches_of(bent_block(ContactLaw::bonded));
  const Identification answer = fitted(bent_block(ContactLaw::bonded), inputs, true);
  const auto said = [&](const std::string& input) {
    const auto at = std::find_if(answer.budget_if.begin(), answer.budget_if.end(), [&](const auto& e) { return e.input == input; });
    return at == answer.budget_if.end() ? -1 : at->young_modulus_percent;
  };
  const auto young_at = [&](double x_m) { return parameter(fitted(bent_block(ContactLaw::bonded, stated_m + Vec3(x_m, 0, 0)), inputs), "young_modulus").value; };
  const double percent = 50 * std::abs(std::log(young_at(1e-3) / young_at(-1e-3)));
  EXPECT_GT(percent, 1);
  EXPECT_NEAR(said("contact_shift"), percent, 0.15 * percent);
  EXPECT_NEAR(said("force_scale"), 1, 0.01) << "E is proportional to the force that was read";
}

TEST(ImposedContact, WhatCannotBeUsedIsSaidByItsField) {
  const Inputs inputs = wrenches_of(bent_block(ContactLaw::bonded));
  Recording recording = bent_block(ContactLaw::bonded);
  EXPECT_FALSE(says(fitted(recording, inputs), "not_in_interval"));
  recording.tools[0].radius_std_m = 1e-3;
  const Identification answer = fitted(recording, inputs);
  ASSERT_TRUE(says(answer, "not_in_interval"));
  const auto said = std::find_if(answer.verdicts.begin(), answer.verdicts.end(), [](const auto& v) { return v.code == "not_in_interval"; });
  EXPECT_NE(said->message.find("radius_std_m"), std::string::npos) << said->message;
}

/// The bent block, and the same pressed beside it by a force that was measured, whose travel was read: one sensor for both.
Recording of_both_kinds(double scale_std) {
  Recording recording = bent_block(ContactLaw::bonded);
  const Recording by_force = pushed_block_recording();
  recording.tools.push_back(by_force.tools[0]);
  recording.pushes.push_back(by_force.pushes[0]);
  recording.pushes[0].name = "moved";
  recording.force_scale_std = scale_std;
  return recording;
}

// A sensor that reads 4 % too little does so whether its force is given or asked for: E is off by as much and no push tells.
TEST(ForceScale, IsOneForForcesThatAreGivenAndThatAreAskedFor) {
  constexpr double scale_std = 0.05, off = 0.04;
  Recording real = of_both_kinds(0);
  for (Step& step : real.pushes[1].steps) *step.loads[0].force_n *= 1 + off;
  Unknowns unknowns;
  ForwardModel model(real, block(), unknowns);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(young_pa);
  at(poisson) = 0.3;
  Inputs inputs;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    const StepPrediction seen = model.predict(s, at, false);
    if (model.push(s).name == "moved") {
      Wrench read;
      read.force_n = seen.force_n[0] / (1 + off);
      read.along = -Vec3::UnitZ();
      read.force_sigma_n = force_sigma_n;
      inputs.push_back({read});
    } else {
      ToolTravel travel;
      travel.travel_m = seen.travel_m(0);
      travel.sigma_m = 1e-6;
      inputs.push_back({travel});
    }
  }
  const Identification answer = fitted(of_both_kinds(scale_std), inputs);
  const Parameter& young = parameter(answer, "young_modulus");
  EXPECT_NEAR(young.value * (1 + off) / young_pa, 1, 0.005) << "no two kinds of pushes that disagree";
  EXPECT_GE(young.std / young.value, 0.99 * scale_std);
  EXPECT_LT(young.std / young.value, 1.1 * scale_std);
  const auto scale = std::find_if(answer.nuisances.begin(), answer.nuisances.end(), [](const auto& n) { return n.name == "force_scale"; });
  ASSERT_NE(scale, answer.nuisances.end());
  EXPECT_NEAR(scale->value, 0, 0.05 * scale_std);
  EXPECT_NEAR(scale->std, scale_std, 0.02 * scale_std);
}

// A tool that stands still while the object relaxes: the force falls and nothing moves.
TEST(HeldTool, ThatIsPushedBackLessAndLessHasNotSettled) {
  Recording held = bent_block(ContactLaw::frictionless);
  auto& steps = held.pushes[0].steps;
  steps.assign(4, steps.back());
  Inputs still = wrenches_of(held), relaxing = still;
  for (std::size_t s = 0; s < relaxing.size(); ++s) std::get<Wrench>(relaxing[s][0]).force_n *= std::exp(-0.03 * static_cast<double>(s));
  const auto said = [&](const Inputs& inputs) {
    std::string message;
    for (const auto& verdict : fitted(held, inputs, true).verdicts)
      if (verdict.code == "not_settled") message = verdict.message;
    return message;
  };
  EXPECT_EQ(said(still), "");
  EXPECT_NE(said(relaxing).find("the force went on falling: E fell by 8.6 %"), std::string::npos) << said(relaxing);
}

}  // namespace
}  // namespace palpate::estimation::imposed_contact_test
