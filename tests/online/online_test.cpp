// label: unit
// SPDX-License-Identifier: Apache-2.0
// The door for a robot at work: estimates after every step, and at the end what `identify` says.
#include "palpate/online.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/pushed_block.hpp"
#include "palpate/core/error.hpp"

namespace palpate {
namespace {

/// The pushed block with its clouds as observations; first an unloaded step.
Recording pushed_block(const estimation::PushedBlock& truth) {
  Recording recording = estimation::pushed_block_recording();
  const estimation::Inputs clouds = estimation::clouds_of(truth, recording);
  for (std::size_t s = 0; s < clouds.size(); ++s) {
    Step& step = recording.pushes[0].steps[s];
    step.time_s = double(s + 1);
    step.observations = {std::get<PointCloud>(clouds[s][0])};
  }
  recording.pushes[0].steps.insert(recording.pushes[0].steps.begin(), Step{});
  recording.rest.volume = estimation::kuhn_block(4, 3, 2, estimation::block_size_m);
  recording.model.refine = "none";
  return recording;
}

TEST(OnlineEstimator, KnowsMoreAfterEveryStepAndEndsWhereIdentifyDoes) {
  const estimation::PushedBlock truth;
  const Recording whole = pushed_block(truth);
  Recording scene = whole;
  scene.pushes.clear();
  IdentifyOptions options;
  options.fit.cross_checks = options.fit.stresses = false;

  OnlineEstimator online(scene, options);
  Push push = whole.pushes[0];
  push.steps.clear();
  online.begin(push);
  EXPECT_TRUE(online.add(whole.pushes[0].steps[0]).parameters.empty());  // nothing has pressed yet
  double before = 10;
  for (std::size_t s = 1; s < whole.pushes[0].steps.size(); ++s) {
    const Identification& now = online.add(whole.pushes[0].steps[s]);
    ASSERT_EQ(now.parameters.size(), 2u) << now.message;
    const Parameter& young = now.parameters[0];
    EXPECT_LT(std::abs(young.value - truth.young_pa), 4 * young.std);
    EXPECT_LT(young.std / young.value, before);
    before = young.std / young.value;
  }
  const Identification batch = identify(whole, options).answer, end = online.answer().answer;
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(end.parameters[k].value, batch.parameters[k].value);
    EXPECT_EQ(end.parameters[k].lower_95, batch.parameters[k].lower_95);
    EXPECT_NEAR(online.estimate().parameters[k].value, batch.parameters[k].value, 0.1 * batch.parameters[k].std);
  }
}

TEST(OnlineEstimator, RefusesAStepAndGoesOnWithoutIt) {
  const Recording whole = pushed_block({});
  Recording scene = whole;
  scene.pushes.clear();
  OnlineEstimator online(scene);
  EXPECT_THROW(online.add(whole.pushes[0].steps[1]), Error);  // no push
  Push push = whole.pushes[0];
  push.steps.clear();
  online.begin(push);
  EXPECT_THROW(online.begin(push), Error);
  Step bad = whole.pushes[0].steps[1];
  bad.loads[0].tool = "no such tool";
  EXPECT_THROW(online.add(bad), Error);
  EXPECT_TRUE(online.recording().pushes[0].steps.empty());
  EXPECT_EQ(online.add(whole.pushes[0].steps[1]).parameters.size(), 2u);
}

}  // namespace
}  // namespace palpate
