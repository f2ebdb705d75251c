// label: unit
// SPDX-License-Identifier: Apache-2.0
// Steps in which several tools act, as a gripper's fingers do: each has sensors and a contact of its own, and unknowns have names that
// do not depend on what else is exactly known.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "palpate/estimation/step_fits.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::several_tools_test {
namespace {

/// The block clamped at one end, pinched at the other by two pads; each tells its force.
Recording pinched_block() {
  Recording recording = pushed_block_recording();
  Tool right = recording.tools[0];
  recording.tools[0].name = "left";
  right.name = "right";
  recording.tools.push_back(right);
  Push& push = recording.pushes[0];
  push.name = "pinch";
  push.force_tare_std_n = 0.05;
  push.travel_offset_std_m = 1e-3;
  for (Step& step : push.steps) {
    Load& above = step.loads[0];
    above.tool = "left";
    above.direction = -Vec3::UnitZ();
    above.contact_std_m = 2e-3;
    Load below = above;
    below.tool = "right";
    below.contact_m.z() = 0;
    below.direction = Vec3::UnitZ();
    below.force_n = -*above.force_n;
    step.loads.push_back(below);
  }
  return recording;
}

VectorX somewhere(const Unknowns& unknowns) {
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(2e4);
  at(poisson) = 0.3;
  return at;
}

SimulatedObject block() { return simulated(kuhn_block(4, 3, 2, block_size_m), "linear"); }

void expect_different_names(const Unknowns& unknowns) {
  std::set<std::string> names;
  for (int k = 0; k < unknowns.size(); ++k) EXPECT_TRUE(names.insert(unknowns[k].name).second) << unknowns[k].name;
}

TEST(SeveralTools, EachHasATareAndAContactOfItsOwn) {
  Recording recording = pinched_block();
  recording.force_cross_talk_std = 0.01;
  for (Step& step : recording.pushes[0].steps)
    for (Load& load : step.loads) load.force_std_n = 0.01;
  Unknowns unknowns;
  ForwardModel model(recording, block(), unknowns);
  expect_different_names(unknowns);
  for (const char* name : {"force_tare[pinch]_x", "force_tare[pinch, right]_x", "force_cross_talk[pinch]_1", "force_cross_talk[pinch, right]_1",
                           "contact_shift[pinch]_1", "contact_shift[pinch, right]_2", "force_error[pinch:1]_z", "force_error[pinch:1, right]_z"})
    EXPECT_EQ(unknowns.named({name}).size(), 1u) << name;

  // The right one reads 30 mN too little along z, the left one is right.
  VectorX at = somewhere(unknowns);
  at(unknowns.named({"force_tare[pinch, right]_z"}).at(0)) = 0.03;
  Recording there = recording;
  for (Step& step : there.pushes[0].steps) *step.loads[1].force_n += Vec3(0, 0, 0.03);
  Unknowns exact;
  ForwardModel other(there, block(), exact);
  const Points by_tare_m = model.predict(1, at).surface_m, by_force_m = other.predict(1, somewhere(exact)).surface_m;
  EXPECT_LT((by_tare_m - by_force_m).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((model.acting_force(1, 0, at)->force_n - *recording.pushes[0].steps[1].loads[0].force_n).norm(), 1e-12);
}

TEST(SeveralTools, EachTravelHasAZeroOfItsOwn) {
  const Recording recording = pinched_block();
  Inputs inputs(2);
  for (auto& step : inputs) {
    for (const char* tool : {"left", "right"}) {
      ToolTravel travel;
      travel.tool = tool;
      travel.travel_m = 1e-3;
      travel.sigma_m = 1e-4;
      step.push_back(travel);
    }
  }
  Unknowns unknowns;
  ForwardModel model(recording, block(), unknowns);
  Objective objective(model, inputs, unknowns);
  expect_different_names(unknowns);
  EXPECT_EQ(unknowns.named({"travel_zero[pinch]", "travel_zero[pinch, right]"}).size(), 2u);
}

TEST(SeveralTools, APushThatDrivesBothHasTwoOffsets) {
  Recording recording = pinched_block();
  for (Tool& tool : recording.tools) tool.contact = ContactLaw::frictionless;
  for (Step& step : recording.pushes[0].steps) {
    for (Load& load : step.loads) {
      load.force_n.reset();
      load.travel_m = 1e-3;
      load.contact_std_m = 0;
    }
  }
  Unknowns unknowns;
  ForwardModel model(recording, block(), unknowns);
  EXPECT_EQ(unknowns.named({"travel_offset[pinch]", "travel_offset[pinch, right]"}).size(), 2u);
  // A tare of one finger is read by that one alone: what is true is by as much more than what it reads.
  VectorX at = somewhere(unknowns);
  const StepPrediction before = model.predict(0, at);
  at(unknowns.named({"force_tare[pinch, right]_x"}).at(0)) = 0.02;
  const StepPrediction after = model.predict(0, at);
  EXPECT_LT((after.force_n[0] - before.force_n[0]).norm(), 1e-9);
  EXPECT_LT((after.force_n[1] - before.force_n[1] + Vec3(0.02, 0, 0)).norm(), 1e-9);
}

// The tables of a result speak of the step's first load.
TEST(SeveralTools, ReadingsOfASecondToolAreNotTheFirstOnes) {
  const Recording stated = pinched_block();
  Recording recording = stated;
  Inputs inputs(2);
  for (std::size_t s = 0; s < 2; ++s) {
    for (std::size_t l = 0; l < 2; ++l) {
      ToolTravel travel;
      travel.tool = stated.pushes[0].steps[s].loads[l].tool;
      travel.travel_m = l == 0 ? 1e-3 : 3e-3;
      travel.sigma_m = 1e-4;
      Wrench wrench;
      wrench.tool = travel.tool;
      wrench.force_n = (l == 0 ? 0.1 : 0.7) * stated.pushes[0].steps[s].loads[l].direction;
      wrench.force_sigma_n = 0.01;
      recording.pushes[0].steps[s].observations.push_back(travel);
      recording.pushes[0].steps[s].observations.push_back(wrench);
      inputs[s].push_back(travel);
    }
  }
  Unknowns unknowns;
  ForwardModel model(recording, block(), unknowns);
  Objective objective(model, inputs, unknowns);
  ASSERT_TRUE(objective.evaluate(somewhere(unknowns), {}).usable);
  for (const StepFit& fit : step_fits(objective)) {
    EXPECT_NEAR(fit.travel_m, 1e-3, 1e-12);
    EXPECT_NEAR(fit.force_measured_n, 0.1, 1e-12);
  }
}

TEST(SeveralTools, PlacesThatOneToolTouchesAreToldApart) {
  Recording recording = pushed_block_recording();
  auto& steps = recording.pushes[0].steps;
  for (Step& step : steps) step.loads[0].contact_std_m = 1e-3;
  steps[1].loads[0].contact_m.x() -= 0.004;
  Unknowns unknowns;
  ForwardModel model(recording, block(), unknowns);
  EXPECT_EQ(unknowns.named({"contact_shift[down]_1", "contact_shift[down, finger 2]_1"}).size(), 2u);
  expect_different_names(unknowns);
}

TEST(SeveralSensors, CloudsOfAStepAreToldApartWhicheverIsExact) {
  const Recording recording = pushed_block_recording();
  for (const bool first_exact : {false, true}) {
    Inputs inputs = clouds_of({});
    for (auto& step : inputs) {
      step.push_back(step[0]);
      for (std::size_t i = first_exact ? 1 : 0; i < 2; ++i) std::get<PointCloud>(step[i]).pose_std_m = 1e-3;
    }
    Unknowns unknowns;
    ForwardModel model(recording, block(), unknowns);
    Objective objective(model, inputs, unknowns);
    expect_different_names(unknowns);
    EXPECT_EQ(unknowns.named({"frame_x[down:0]"}).size(), first_exact ? 0u : 1u);
    EXPECT_EQ(unknowns.named({"frame2_x[down:0]", "frame2_rotation_z[down:1]"}).size(), 2u);
  }
}

}  // namespace
}  // namespace palpate::estimation::several_tools_test
