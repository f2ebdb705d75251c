// label: oracle
// SPDX-License-Identifier: Apache-2.0
// A force sensor that reads across a push a little of what acts along it: E and nu of the lab's cube, with that stated and not.
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/identify.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab::cross_talk_test {
namespace {

/// In standard deviations that the answer states.
struct Off {
  double log_young = 0, poisson = 0;
};

Off off_by(std::uint64_t seed, bool stated) {
  LabOptions options;
  options.seed = seed;
  options.force = force_sensor("schunk_ftcl_050");
  options.camera_std_m = options.camera_std_rad = 1e-5;  // that nothing else hides it
  ObjectOptions truth;
  truth.seed = seed;
  truth.material = "linear";
  LabObject object = make_object("cube", truth);
  object.sites.resize(1);
  LabRobot robot(options, std::move(object));
  Recording recording = robot.scene();
  recording.model.material = "linear";
  EXPECT_GT(recording.force_cross_talk_std, 0);
  if (!stated) recording.force_cross_talk_std = 0;
  acquisition::PushOptions protocol;
  protocol.travel_limit_m = robot.object().travel_limit_m;
  protocol.unloading_steps = 0;
  protocol.force_step_n = robot.object().force_step_at(robot.object().sites[0]);
  recording.pushes = {acquisition::whole_push(robot, robot.plan(0), protocol)};
  IdentifyOptions quick;
  quick.fit.cross_checks = quick.fit.stresses = false;
  const Identification answer = identify(recording, quick).answer;
  const Parameter &young = answer.parameters.at(0), &poisson = answer.parameters.at(1);
  return {std::log(young.value / robot.object().young_modulus_pa) / (young.std / young.value),
          (poisson.value - robot.object().poisson_ratio) / poisson.std};
}

TEST(CrossTalk, StatedItIsInTheInterval) {
  double most_unstated = 0;
  for (const std::uint64_t seed : {3u, 8u}) {
    const Off stated = off_by(seed, true), unstated = off_by(seed, false);
    EXPECT_LT(std::abs(stated.poisson), 3) << seed;
    EXPECT_LT(std::abs(stated.log_young), 3) << seed;
    most_unstated = std::max(most_unstated, std::abs(unstated.poisson));
  }
  EXPECT_GT(most_unstated, 4) << "or this tests nothing";
}

}  // namespace
}  // namespace palpate::lab::cross_talk_test
