// label: unit
// SPDX-License-Identifier: Apache-2.0
// Pushes that were cut off and go on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "acquisition/spring_robot.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition::push_resume_test {
namespace {

Push killed_after(std::size_t steps, SpringRobot& robot) {
  struct Killed {};
  Push so_far;
  try {
    run_push(robot, plan(), options(), [&](const Push& push, const Step& step) {
      if (so_far.steps.size() == steps) throw Killed{};
      std::vector<Step> before = std::move(so_far.steps);
      so_far = push;
      so_far.steps = std::move(before);
      so_far.steps.push_back(step);
    });
    ADD_FAILURE() << "was not killed";
  } catch (const Killed&) {
  }
  EXPECT_EQ(so_far.steps.size(), steps);
  return so_far;
}

TEST(PushProtocol, GoesOnAfterAKillAtEveryStep) {
  SpringRobot whole_robot;
  const Push whole = run(whole_robot).push;
  for (std::size_t killed = 0; killed < whole.steps.size(); ++killed) {
    SpringRobot robot;
    Push so_far = killed_after(killed, robot);
    SpringRobot fresh;
    fresh.clock_s = robot.clock_s + 60;
    const Result rest = run(fresh, options(), {}, &so_far);
    EXPECT_EQ(rest.report.stop, StopReason::force_limit) << rest.report.message;
    EXPECT_EQ(rest.report.steps, int(whole.steps.size() - killed));
    EXPECT_GE(rest.report.highest_force_n, 7.8) << "of the whole push";
    EXPECT_EQ(rest.report.drift.has_value(), killed + 1 < whole.steps.size()) << "nothing is left that a drift could spoil";
    for (const Step& step : rest.push.steps) so_far.steps.push_back(step);
    // The same steps as if nothing had happened, each once.
    ASSERT_EQ(so_far.steps.size(), whole.steps.size()) << killed;
    double time = -1;
    for (std::size_t i = 0; i < whole.steps.size(); ++i) {
      EXPECT_GT(so_far.steps[i].time_s, time) << killed;
      time = so_far.steps[i].time_s;
      EXPECT_EQ(so_far.steps[i].unloading, whole.steps[i].unloading) << killed;
      EXPECT_EQ(so_far.steps[i].loads.empty(), whole.steps[i].loads.empty()) << killed;
      EXPECT_NEAR(force(so_far.steps[i]), force(whole.steps[i]), 0.5) << killed << ", step " << i;
    }
  }
  SpringRobot fresh;
  const Result nothing = run(fresh, options(), {}, &whole);
  EXPECT_EQ(nothing.report.steps, 0);
  EXPECT_EQ(nothing.report.stop, StopReason::force_limit);
  EXPECT_FALSE(nothing.report.compared);
  EXPECT_LT(fresh.highest_n, 1e-9) << "nobody touched it";
}

// The sensor's zero is another one after the pause, and the first touch falls elsewhere within an increment: all steps of the
// push still lie on one line within what the push states once for all of them, and each for itself.
TEST(PushProtocol, WhatGoesOnHasTheOffsetsOfWhatIsRecorded) {
  double between = 0;
  constexpr int seeds = 60;
  for (unsigned seed = 1; seed <= seeds; ++seed) {
    SpringRobot robot;
    robot.generator.seed(seed);
    robot.relaxation = 0;
    Push push = killed_after(3 + seed % 4, robot);
    const std::size_t cut = push.steps.size();
    SpringRobot later;
    later.generator.seed(1000 + seed);
    later.relaxation = 0;
    later.clock_s = robot.clock_s + 600;
    later.bias_n += Vec3(0.5, -0.3, 1.0);
    PushOptions o = options();
    o.start_distance_m += 1e-5 * seed;
    const Result rest = run(later, o, {}, &push);
    ASSERT_EQ(rest.report.stop, StopReason::force_limit) << rest.report.message;
    EXPECT_LT((rest.report.tare_n - later.bias_n).norm(), 0.02);
    double lowest_m = 1, highest_m = -1, sum[2] = {0, 0}, variance[2] = {0, 0}, count[2] = {0, 0};
    for (const Step& step : rest.push.steps) push.steps.push_back(step);
    for (std::size_t i = 0; i < push.steps.size(); ++i) {
      const Step& step = push.steps[i];
      if (step.loads.empty()) continue;
      const double depth_m = 0.1 - step.T_base_tip->translation().z();
      const double zero_m = std::get<ToolTravel>(step.observations.front()).travel_m - depth_m;
      lowest_m = std::min(lowest_m, zero_m);
      highest_m = std::max(highest_m, zero_m);
      const int part = i >= cut;
      sum[part] += force(step) - 400 * depth_m;
      variance[part] += std::pow(step.loads[0].force_std_n, 2);
      ++count[part];
    }
    EXPECT_LT(highest_m - lowest_m, 1e-12) << "one zero of the travel";
    EXPECT_EQ(rest.push.travel_offset_std_m, push.travel_offset_std_m);
    ASSERT_GT(count[0] * count[1], 0);
    const double difference_n = sum[1] / count[1] - sum[0] / count[0];
    between += std::pow(difference_n, 2) / (variance[0] / std::pow(count[0], 2) + variance[1] / std::pow(count[1], 2));
  }
  // Not more than what is stated; somewhat less, for a push that goes on does not know how many steps will follow.
  EXPECT_LT(std::sqrt(between / seeds), 1.2);
  EXPECT_GT(std::sqrt(between / seeds), 0.5);
}

TEST(PushProtocol, WhatMovedInThePauseIsNotPushedAsIfItHadNot) {
  SpringRobot robot;
  const Push so_far = killed_after(3, robot);
  SpringRobot later;
  later.clock_s = robot.clock_s + 600;
  later.surface_m -= 0.004;
  const Result rest = run(later, options(), {}, &so_far);
  EXPECT_EQ(rest.report.stop, StopReason::moved);
  EXPECT_THAT(rest.report.message, testing::HasSubstr("mm deeper than in the part that is recorded"));
  ASSERT_EQ(rest.push.steps.size(), 1u);
  EXPECT_TRUE(rest.push.steps[0].loads.empty());
  EXPECT_LT(later.depth(), 0);
}

}  // namespace
}  // namespace palpate::acquisition::push_resume_test
