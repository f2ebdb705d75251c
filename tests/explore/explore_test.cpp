// label: unit
// SPDX-License-Identifier: Apache-2.0
// The loop of push, estimate, next push on a small robot with a truth of its own. PALPATE_LABS=40 explore_unit_tests --gtest_filter='Explore.*'
// --gtest_filter='*Fewer*' compares the orders on forty of them.
#include "palpate/explore.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <vector>

#include "small_loop.hpp"
#include "palpate/core/error.hpp"

namespace palpate::explore_test {
namespace {

TEST(Explore, EndsWhenBothIntervalsAreAsNarrowAsAskedForAndHoldTheTruth) {
  BlockRobot robot(1);
  const Tried run = explored(robot, loop_options());
  const Explored& found = run.found;
  ASSERT_TRUE(found.reached) << found.message;
  ASSERT_FALSE(found.pushes.empty());
  const ExploredPush& last = found.pushes.back();
  EXPECT_LE(young_modulus_half_width(last), 0.04);
  EXPECT_LE(poisson_ratio_half_width(last.poisson_ratio), 0.014);
  for (std::size_t i = 0; i + 1 < found.pushes.size(); ++i)
    EXPECT_TRUE(young_modulus_half_width(found.pushes[i]) > 0.04 ||
                poisson_ratio_half_width(found.pushes[i].poisson_ratio) > 0.014);
  EXPECT_NEAR(std::log(last.young_moduli.front().value / estimation::true_young_pa), 0, 0.07);
  EXPECT_NEAR(last.poisson_ratio.value, estimation::true_poisson, 0.035);
  // What was promised for each push came about, within a factor of two (the stick hides nothing from this camera).
  for (const auto& push : found.pushes) {
    EXPECT_LT(std::abs(std::log(push.found.log_young_std / push.plan.expected.log_young_std)), std::log(2.0)) << push.name;
    EXPECT_LT(push.report.highest_force_n, 50);
  }
  EXPECT_EQ(found.pushes.front().pushes_planned, static_cast<int>(found.pushes.size()));
  EXPECT_EQ(last.pushes_planned, 1);
  // Whoever had written a list down before is expected to push more often; that this is so, the comparison of orders below shows.
  ASSERT_TRUE(found.fixed_lists);
  EXPECT_GE(found.fixed_lists->candidates, 8);
  EXPECT_GT(found.fixed_lists->random.value_or(1000), static_cast<int>(found.pushes.size()));
  EXPECT_GE(found.fixed_lists->repeated.value_or(1000), static_cast<int>(found.pushes.size()));
  // The recording is the whole of it, and every step was handed over as it was made.
  ASSERT_EQ(found.recording.pushes.size(), found.pushes.size());
  std::size_t steps = 0;
  for (const auto& push : found.recording.pushes) steps += push.steps.size();
  EXPECT_EQ(static_cast<std::size_t>(run.steps), steps);
  EXPECT_EQ(static_cast<std::size_t>(run.begun), found.pushes.size());
  EXPECT_EQ(static_cast<std::size_t>(run.told), found.pushes.size());
  EXPECT_GT(found.identified.volume.tetrahedra.rows(), 0);
}

int labs() {
  const char* text = std::getenv("PALPATE_LABS");
  return text != nullptr ? std::max(1, std::atoi(text)) : 1;
}

/// Medians, over labs, of the loop's pushes over those of the other orders.
struct Shares {
  double of_random = 0, of_repeated = 0;
};

/// @param harder  as BlockRobot's  @param look  at what the loop found
Shares shares_of_pushes(double harder, ExploreOptions options, const std::function<void(const Explored&)>& look) {
  std::vector<double> of_random, of_repeated;
  for (int seed = 1; seed <= labs(); ++seed) {
    std::size_t pushes[3];
    for (const PushOrder order : {PushOrder::next_best, PushOrder::random, PushOrder::best_repeated}) {
      BlockRobot robot(static_cast<unsigned>(seed), harder);
      options.order = order;
      options.seed = static_cast<std::uint64_t>(seed);
      const Explored found = explored(robot, options).found;
      pushes[static_cast<int>(order)] = count(found);
      if (order != PushOrder::next_best) continue;
      EXPECT_TRUE(found.reached) << found.message;
      look(found);
    }
    std::printf("seed %d: next best %zu, random %zu, repeated %zu (%d: or more)\n", seed, pushes[0], pushes[1], pushes[2],
                options.max_pushes);
    std::fflush(stdout);
    of_random.push_back(static_cast<double>(pushes[0]) / static_cast<double>(pushes[1]));
    of_repeated.push_back(static_cast<double>(pushes[0]) / static_cast<double>(pushes[2]));
  }
  const auto median = [](std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v[v.size() / 2];
  };
  const Shares shares{median(of_random), median(of_repeated)};
  std::printf("share of the pushes, median of %d: %.2f of the random order's, %.2f of the repeated one's\n", labs(), shares.of_random,
              shares.of_repeated);
  return shares;
}

TEST(Explore, NextBestPushNeedsFewerPushesThanARandomOrderOrTheBestPlaceRepeated) {
  ExploreOptions options = loop_options();
  options.young_modulus_within = labs() > 1 ? 0.032 : 0.04;
  options.poisson_ratio_within = labs() > 1 ? 0.009 : 0.011;
  options.max_pushes = labs() > 1 ? 12 : 6;
  const Shares shares = shares_of_pushes(1, options, [](const Explored&) {});
  EXPECT_LE(shares.of_random, 2.0 / 3);
  EXPECT_LE(shares.of_repeated, 1);
}

TEST(Explore, BothHalvesOfABlockAreFoundInFewerPushesThanByChanceOrAtOnePlace) {
  constexpr double harder = 1.5;
  ExploreOptions options = loop_options();
  options.young_modulus_within = labs() > 1 ? 0.04 : 0.05;
  options.poisson_ratio_within = labs() > 1 ? 0.015 : 0.03;
  options.max_pushes = 12;
  const Shares shares = shares_of_pushes(harder, options, [&](const Explored& found) {
    ASSERT_GE(found.pushes.size(), 2u);
    const ExploredPush& last = found.pushes.back();
    ASSERT_EQ(last.young_moduli.size(), 2u);
    EXPECT_LE(young_modulus_half_width(last), options.young_modulus_within);
    EXPECT_NEAR(std::log(last.young_moduli[0].value / estimation::true_young_pa), 0, 0.07);
    EXPECT_NEAR(std::log(last.young_moduli[1].value / estimation::true_young_pa / harder), 0, 0.07);
    for (const auto& push : found.pushes) {  // what was promised for the half that was pressed came about
      const double promised = push.plan.expected.region_log_young_std(push.plan.region);
      EXPECT_LT(std::abs(std::log(push.found.region_log_young_std(push.plan.region) / promised)), std::log(2.0)) << push.name;
    }
    EXPECT_EQ(found.pushes[0].plan.region + found.pushes[1].plan.region, 1) << "each half has to be felt";
  });
  EXPECT_LE(shares.of_random, 2.0 / 3);
  EXPECT_LE(shares.of_repeated, 2.0 / 3);
}

TEST(Explore, BudgetRefusalAndUserEndIt) {
  ExploreOptions options = loop_options();
  options.max_pushes = 1;
  options.young_modulus_within = 1e-4;
  BlockRobot robot(2);
  const Explored one = explored(robot, options).found;
  EXPECT_FALSE(one.reached);
  EXPECT_EQ(one.pushes.size(), 1u);
  EXPECT_EQ(one.message, "all pushes are used up");

  BlockRobot stubborn(2);
  stubborn.refuses = true;
  options.max_pushes = 3;
  const Explored none = explored(stubborn, options).found;
  EXPECT_EQ(none.fruitless, 3);
  EXPECT_TRUE(none.pushes.empty());
  EXPECT_TRUE(none.recording.pushes.empty());
  EXPECT_EQ(stubborn.places, 3) << "a place that failed is not tried again";

  BlockRobot stopped(2);
  int asked = 0;
  const Explored half = explored(stopped, options, [&](const Tried&) { return ++asked < 60; }).found;
  EXPECT_FALSE(half.reached);
  EXPECT_EQ(half.message, "stopped on request");
}

// Hours of pushes must not be lost to the wish to end.
TEST(Explore, StoppedInAFitItKeepsWhatWasKnownBefore) {
  ExploreOptions options = loop_options();
  options.young_modulus_within = 1e-4;
  options.max_pushes = 2;
  const auto in_fit_after = [](int pushes) {
    return [pushes](const Tried& so_far, std::string_view stage) { return so_far.told < pushes || stage != "fit"; };
  };
  BlockRobot robot(1), stopped(1), at_first(1);
  const Explored one = explored(robot, options, [](const Tried& so_far) { return so_far.told < 1; }).found;
  ASSERT_EQ(one.pushes.size(), 1u);
  EXPECT_EQ(one.message, "stopped on request");

  const Explored found = explored(stopped, options, {}, nullptr, in_fit_after(1)).found;
  EXPECT_EQ(found.message, "push 2 is recorded, but not in the estimate: stopped on request");
  EXPECT_EQ(found.identified.answer.termination, Termination::converged);
  ASSERT_FALSE(found.identified.answer.parameters.empty());
  EXPECT_EQ(found.identified.answer.parameters.front().value, one.identified.answer.parameters.front().value);
  EXPECT_EQ(found.pushes.size(), 1u);
  EXPECT_EQ(found.recording.pushes.size(), 2u);
  EXPECT_FALSE(found.fixed_lists) << "nobody waits for them";

  const Explored none = explored(at_first, options, {}, nullptr, in_fit_after(0)).found;
  EXPECT_EQ(none.message, "push 1 is recorded, but nothing is estimated: stopped on request");
  EXPECT_EQ(none.identified.answer.termination, Termination::cancelled);
  EXPECT_TRUE(none.pushes.empty());
  EXPECT_EQ(none.recording.pushes.size(), 1u);
}

TEST(Explore, StoppedInTheLastChecksItKeepsTheEstimate) {
  ExploreOptions options = loop_options();
  options.young_modulus_within = options.poisson_ratio_within = 0.5;
  options.identify.fit.cross_checks = true;
  BlockRobot robot(1);
  const Explored found =
      explored(robot, options, {}, nullptr, [](const Tried& so_far, std::string_view stage) { return so_far.told < 1 || stage != "fit"; }).found;
  EXPECT_TRUE(found.reached);
  EXPECT_EQ(found.message, "stopped on request in the last checks: both intervals are as narrow as was asked for");
  EXPECT_EQ(found.identified.answer.termination, Termination::converged);
  ASSERT_FALSE(found.identified.answer.parameters.empty());
  EXPECT_EQ(found.identified.answer.parameters.front().value, found.pushes.back().young_moduli.front().value);
}

// Two halves that differ by two thirds, and nobody has said so: what is narrow is not E of anything.
TEST(Explore, NarrowIntervalsThatAreNotToBeBelievedAreNoGoal) {
  ExploreOptions options = loop_options();
  options.max_pushes = 4;
  options.identify.fit.cross_checks = true;
  BlockRobot robot(1, 2.5);
  Recording scene = robot.scene();
  scene.regions.clear();
  const Explored found = explored(robot, options, {}, &scene).found;
  std::string codes;
  for (const Verdict& verdict : found.identified.answer.verdicts) codes += verdict.code + " ";
  EXPECT_FALSE(found.reached) << found.message;
  EXPECT_NE(found.message.find("not to be believed: "), std::string::npos) << found.message << "; " << codes;
}

TEST(Explore, StoppedWhileItRanksPushesItDoesNotBlameTheCamera) {
  BlockRobot robot(1);
  const Explored found =
      explored(robot, loop_options(), {}, nullptr, [](const Tried&, std::string_view stage) { return stage != "rate pushes"; }).found;
  EXPECT_EQ(found.message, "stopped on request");
  EXPECT_EQ(robot.places, 0);
}

// What the robot bears bounds what is planned, what the first touch sizes and what is pressed, and the report says so.
TEST(Explore, TheRobotsOwnLimitsHold) {
  struct Weak : BlockRobot {
    using BlockRobot::BlockRobot;
    acquisition::RobotLimits bears;
    acquisition::RobotLimits limits() const override { return bears; }
  };
  ExploreOptions options = loop_options();
  options.max_pushes = 2;
  options.young_modulus_within = 1e-4;
  Weak strong(3);
  const Explored free = explored(strong, options).found;
  ASSERT_EQ(free.pushes.size(), 2u);
  double most_n = 0;
  for (const auto& push : free.pushes) {
    EXPECT_NE(push.report.stop, acquisition::StopReason::robot_force_limit);
    most_n = std::max(most_n, push.report.highest_force_n);
  }
  Weak weak(3);
  weak.bears.force_n = 0.4 * most_n;
  const Explored held = explored(weak, options).found;
  ASSERT_EQ(held.pushes.size(), 2u);
  for (const auto& push : held.pushes) {
    EXPECT_LE(push.plan.force_n, weak.bears.force_n * (1 + 1e-9));
    EXPECT_LT(push.report.highest_force_n, weak.bears.force_n + 0.3) << push.name;
  }
  EXPECT_EQ(held.pushes.front().report.stop, acquisition::StopReason::robot_force_limit) << held.pushes.front().report.message;
  for (const Push& push : held.recording.pushes)
    EXPECT_GE(std::count_if(push.steps.begin(), push.steps.end(), [](const Step& step) { return !step.loads.empty(); }), options.levels)
        << "in as many steps as are wanted";
}

TEST(Explore, BadOptionsAreNamed) {
  BlockRobot robot(1);
  ExploreHooks hooks;
  EXPECT_THROW(explore(robot, robot.scene(), {}, hooks), Error);
  hooks.plan = [&](const estimation::PushCandidate& at) { return robot.plan(at); };
  ExploreOptions options;
  options.young_modulus_within = 0;
  EXPECT_THROW(explore(robot, robot.scene(), options, hooks), Error);
  options = {};
  options.identify.method = "paper";
  EXPECT_THROW(explore(robot, robot.scene(), options, hooks), Error);
}

}  // namespace
}  // namespace palpate::explore_test
