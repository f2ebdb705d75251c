// label: oracle
// SPDX-License-Identifier: Apache-2.0
// An object whose shape nobody gave: seven depth images around it, then pushes; the answer holds the truth all the same, and
// says what the shape's error costs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/core/error.hpp"
#include "palpate/identify.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab::views_test {
namespace {

TEST(Views, ShapeOutOfDepthImagesIsGoodEnoughToMeasureWith) {
  ObjectOptions truth;
  truth.seed = 3;
  truth.material = "linear";
  LabOptions options;
  options.seed = 3;
  LabRobot robot(options, make_object("cube", truth));
  Recording recording = robot.scene();
  recording.rest.surface.reset();
  recording.rest.views = robot.look_around(7);
  acquisition::PushOptions protocol;
  protocol.travel_limit_m = robot.object().travel_limit_m;
  protocol.force_step_n = 3 * robot.object().force_step_at(robot.object().sites[0]);
  protocol.unloading_steps = 0;
  recording.pushes.push_back(acquisition::whole_push(robot, robot.plan(0), protocol));

  IdentifyOptions identification;
  identification.refine = "none";
  const Identification answer = identify(recording, identification).answer;
  ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
  const Parameter &young = answer.parameters[0], &poisson = answer.parameters[1];
  EXPECT_LT(std::abs(std::log(young.value / robot.object().young_modulus_pa)), 3 * young.std / young.value) << young.value;
  EXPECT_LT(young.std / young.value, 0.05);
  EXPECT_LT(std::abs(poisson.value - robot.object().poisson_ratio), 3 * poisson.std) << poisson.value;
  const auto field = std::find_if(answer.nuisances.begin(), answer.nuisances.end(),
                                  [](const Nuisance& nuisance) { return nuisance.name.rfind("rest_surface", 0) == 0; });
  ASSERT_NE(field, answer.nuisances.end());  // nobody stated how far the shape may be off: the images did
  EXPECT_GT(field->prior_std, 1e-5);
  EXPECT_LT(field->prior_std, 2e-3);
}

TEST(Views, LookingAroundNeedsAView) {
  const LabRobot robot{LabOptions{}};
  EXPECT_THROW(robot.look_around(0), Error);
}

}  // namespace
}  // namespace palpate::lab::views_test
