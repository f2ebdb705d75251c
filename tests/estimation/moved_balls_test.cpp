// label: oracle
// SPDX-License-Identifier: Apache-2.0
// A ball whose force and travel were measured, as robots record it: Hertz's closed form is the measure.
#include "palpate/estimation/moved_balls.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "palpate/core/observed_travel.hpp"
#include "palpate/identify.hpp"
#include "palpate/online.hpp"
#include "pushed_block.hpp"
#include "refusals.hpp"

namespace palpate::estimation::moved_balls_test {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr double young_pa = 1e4, nu = 0.3, radius_m = 0.015;
constexpr double sigma_m = 2e-5, sigma_n = 0.002;

/// Hertz, F = 4/3 E / (1 - nu^2) sqrt(R) d^1.5, of a layer that is bonded underneath (Dimitriadis et al. 2002): 7 to
/// 11 % stiffer here.
double hertz_n(double depth_m) {
  constexpr double pi = std::numbers::pi, thick_m = 0.05;
  const double chi = std::sqrt(radius_m * depth_m) / thick_m;
  const double a = -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1 - nu), b = (0.6387 - 1.0277 * nu + 1.5164 * nu * nu) / (1 - nu);
  const double layer = 1 - 2 * a / pi * chi + 4 * a * a / (pi * pi) * chi * chi - 8 / std::pow(pi, 3) * (a * a * a + 4 * pi * pi / 15 * b) * std::pow(chi, 3) +
                       16 * a / std::pow(pi, 4) * (a * a * a + 3 * pi * pi / 5 * b) * std::pow(chi, 4);
  return 4.0 / 3 * young_pa / (1 - nu * nu) * std::sqrt(radius_m) * std::pow(depth_m, 1.5) * layer;
}

/// Finer under the ball, at the middle of the top: 3.5 mm there.
TetMesh block() {
  const Vec3 size_m(0.08, 0.08, 0.05);
  TetMesh mesh = kuhn_block(8, 8, 5, size_m);
  const auto drawn_in = [](double s) { return s * (0.35 + 0.65 * s * s); };  // from -1 to 1
  for (Index n = 0; n < mesh.nodes_m.rows(); ++n) {
    for (int d = 0; d < 2; ++d) mesh.nodes_m(n, d) = 0.5 * size_m(d) * (1 + drawn_in(2 * mesh.nodes_m(n, d) / size_m(d) - 1));
    mesh.nodes_m(n, 2) = size_m.z() * (1 - drawn_in(1 - mesh.nodes_m(n, 2) / size_m.z()));
  }
  return mesh;
}

/// A ball into a block on a table, as a wrist sensor and an encoder saw it.
Recording pressed_block(unsigned seed) {
  Recording recording = pushed_block_recording();
  recording.rest.volume = block();
  recording.supports[0].kind = SupportKind::plane;
  recording.supports[0].plane = {Vec3::Zero(), Vec3::UnitZ()};
  Tool ball;
  ball.name = "ball";
  ball.radius_m = radius_m;
  ball.contact = ContactLaw::frictionless;
  recording.tools = {ball};
  recording.model.mesh = "as_given";
  recording.model.refine = "none";
  recording.model.material = "linear";
  recording.model.poisson_fixed = nu;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise;
  Push& push = recording.pushes[0];
  push.force_tare_std_n = 0.001;
  push.steps.clear();
  for (const double depth_m : {0.0, 0.001, 0.0015, 0.002}) {
    Load load;
    load.tool = "ball";
    load.contact_m = Vec3(0.04, 0.04, 0.05);
    load.force_n = Vec3(0, 0, depth_m > 0 ? -hertz_n(depth_m) + sigma_n * noise(random) : 0);
    load.force_std_n = sigma_n;
    ToolTravel travel;
    travel.travel_m = depth_m > 0 ? depth_m + sigma_m * noise(random) : 0;
    travel.sigma_m = sigma_m;
    Step step;
    step.time_s = static_cast<double>(push.steps.size());
    step.loads = {load};
    step.observations = {travel};
    push.steps.push_back(step);
  }
  return recording;
}

TEST(MovedBalls, AnEOfForceAndTravelIsHertzs) {
  const Recording recording = pressed_block(1);
  IdentifyOptions options;
  options.fit.cross_checks = false;
  const Identified found = identify(recording, options);
  const Parameter& young = found.answer.parameters[0];
  EXPECT_NEAR(young.value / young_pa, 1, 0.05) << "the mesh, which stays as it is";
  EXPECT_LT(young.lower_95, young_pa);
  EXPECT_GT(young.upper_95, 0.97 * young_pa);
  EXPECT_THAT(found.object.warnings, Contains(HasSubstr("'ball' is a ball")));
  ASSERT_EQ(found.answer.steps.size(), 4U);
  EXPECT_NEAR(found.answer.steps[3].force_measured_n, hertz_n(0.002), 5 * sigma_n);
  EXPECT_NEAR(found.answer.steps[3].force_predicted_n, hertz_n(0.002), 0.05 * hertz_n(0.002));

  // The same, had its author given a patch of the ball's radius.
  Recording patch = recording;
  patch.tools[0].shape = ToolShape::disc;
  EXPECT_LT(identify(patch, options).answer.parameters[0].value, 0.5 * young_pa) << "what is at stake";
}

TEST(MovedBalls, TheForceIsWhatWasObservedAlongThePush) {
  Recording recording = pressed_block(2);
  Step& last = recording.pushes[0].steps.back();
  last.loads[0].force_n = Vec3(0.3, 0, -2);
  last.loads[0].force_relative_std = 0.02;
  last.loads[0].force_rate_n_s = Vec3(0, 1, -5);
  recording.time_offset_std_s = 0.01;
  Wrench felt;  // its torque is about nothing once the motion is imposed
  felt.force_n = Vec3(0, 0, -2);
  last.observations.push_back(felt);
  const Recording moved = with_balls_moved(recording);
  const Step& step = moved.pushes[0].steps.back();
  EXPECT_FALSE(step.loads[0].force_n);
  EXPECT_EQ(*step.loads[0].travel_m, std::get<ToolTravel>(step.observations[0]).travel_m);
  ASSERT_EQ(step.observations.size(), 2U);
  const auto& read = std::get<Wrench>(step.observations[1]);
  EXPECT_EQ(read.force_n, Vec3(0, 0, -2));
  EXPECT_EQ(read.along, Vec3(0, 0, -1));
  EXPECT_NEAR(read.force_sigma_n, std::hypot(sigma_n, 0.02 * Vec3(0.3, 0, -2).norm()), 1e-12);
  EXPECT_EQ(step.loads[0].force_rate_n_s, Vec3(0, 1, -5)) << "what the clocks differ by is no noise of this step";
  EXPECT_TRUE(moved.pushes[0].steps.front().loads.empty()) << "not yet touching: it is not there";
  EXPECT_TRUE(moved.pushes[0].steps.front().observations.empty()) << "and says nothing of where it stands";
  const Recording again = with_balls_moved(moved);
  EXPECT_EQ(again.warnings.size(), moved.warnings.size());
}

// As files give them: where only a force is given its direction is that of the push, and of no force there is none.
TEST(MovedBalls, TheyGoAlongTheLineOfTheHardestStep) {
  Recording recording = pressed_block(4);
  std::vector<Step>& steps = recording.pushes[0].steps;
  steps[0].loads[0].direction = Vec3::UnitX();
  steps[1].loads[0].direction = Vec3(0.2, 0, -1).normalized();
  steps[1].loads[0].contact_m += Vec3(3e-4, 0, 0);
  const Recording moved = with_balls_moved(recording);
  for (std::size_t s = 1; s < steps.size(); ++s) {
    EXPECT_EQ(moved.pushes[0].steps[s].loads.at(0).direction, -Vec3::UnitZ()) << s;
    EXPECT_EQ(moved.pushes[0].steps[s].loads.at(0).contact_m, Vec3(0.04, 0.04, 0.05)) << s;
  }
  IdentifyOptions options;
  options.fit.cross_checks = false;
  EXPECT_NEAR(identify(recording, options).answer.parameters[0].value / young_pa, 1, 0.05);

  steps[1].loads[0].contact_m += Vec3(4e-3, 0, 0);
  EXPECT_THAT(message_of([&] { with_balls_moved(recording); }), HasSubstr("presses at another place than in other steps of push"));
}

// All forces grew by half of themselves in a second: clocks that are 0.1 s apart make all of them 5 % too large or too small.
TEST(MovedBalls, ClocksThatDifferAreOneErrorOfAllForces) {
  constexpr double apart_s = 0.1, rate_1_s = 0.5;
  const auto spread = [&](double time_offset_std_s) {
    Recording recording = pressed_block(6);
    recording.time_offset_std_s = time_offset_std_s;
    for (Step& step : recording.pushes[0].steps) step.loads[0].force_rate_n_s = rate_1_s * *step.loads[0].force_n;
    IdentifyOptions options;
    options.fit.cross_checks = false;
    const Identified found = identify(recording, options);
    const bool asked = std::any_of(found.answer.nuisances.begin(), found.answer.nuisances.end(), [](const auto& n) { return n.name == "time_offset"; });
    EXPECT_EQ(asked, time_offset_std_s > 0);
    return found.answer.parameters[0].std / found.answer.parameters[0].value;
  };
  const double alike = spread(0), apart = spread(apart_s);
  EXPECT_NEAR(std::sqrt(apart * apart - alike * alike), apart_s * rate_1_s, 0.1 * apart_s * rate_1_s);
}

TEST(MovedBalls, StepByStepTheyAreMovedToo) {
  Recording recording = pressed_block(5);
  IdentifyOptions options;
  options.fit.cross_checks = false;
  const double at_once_pa = identify(recording, options).answer.parameters[0].value;
  const Push push = recording.pushes[0];
  recording.pushes.clear();
  OnlineEstimator estimator(recording, options);
  Push begun = push;
  begun.steps.clear();
  estimator.begin(begun);
  for (const Step& step : push.steps) estimator.add(step);
  ASSERT_FALSE(estimator.estimate().parameters.empty());
  EXPECT_NEAR(estimator.estimate().parameters[0].value / at_once_pa, 1, 0.01);
}

TEST(MovedBalls, OthersKeepTheirForces) {
  const auto keeps = [](const Recording& recording) {
    const Recording same = with_balls_moved(recording);
    EXPECT_THAT(same.warnings, IsEmpty());
    return same.pushes[0].steps.back().loads[0].force_n.has_value();
  };
  const Recording ball = pressed_block(3);
  Recording other = ball;
  other.tools[0].shape = ToolShape::disc;
  EXPECT_TRUE(keeps(other)) << "a pad";
  other = ball;
  other.tools[0].radius_std_m = 0.002;
  EXPECT_TRUE(keeps(other)) << "its patch is known";
  other = ball;
  other.pushes[0].steps[2].observations.clear();
  EXPECT_TRUE(keeps(other)) << "a travel that nobody read";
  other = ball;
  std::get<ToolTravel>(other.pushes[0].steps[2].observations[0]).tool = "stick";
  EXPECT_TRUE(keeps(other)) << "another tool's";
  other = ball;
  other.pushes[0].steps[2].slipped = true;
  EXPECT_TRUE(keeps(other)) << "it slid";
  other = ball;
  other.free = true;
  EXPECT_TRUE(keeps(other)) << "nothing holds it";
}

}  // namespace
}  // namespace palpate::estimation::moved_balls_test
