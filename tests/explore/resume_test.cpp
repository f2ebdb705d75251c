// label: unit
// SPDX-License-Identifier: Apache-2.0
// A loop that was cut off goes on from its recording: what was pushed counts, and it comes to its goal all the same.
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include "small_loop.hpp"

namespace palpate::resume_test {
namespace {

bool is_loaded(const Step& step) { return !step.loads.empty(); }

ExploreOptions going_on(ExploreOptions options) {
  options.go_on = true;
  return options;
}

std::set<std::string> names(const Explored& run) {
  std::set<std::string> all;
  for (const Push& push : run.recording.pushes) all.insert(push.name);
  return all;
}

ExploreOptions some_pushes() {
  ExploreOptions options = loop_options();
  options.young_modulus_within = 0.03;
  options.poisson_ratio_within = 0.011;
  return options;
}

TEST(Resume, StoppedBetweenPushesItNeedsAsManyAsIfNothingHadBeen) {
  const ExploreOptions options = some_pushes();
  BlockRobot whole(1);
  const Explored undisturbed = explored(whole, options).found;
  ASSERT_TRUE(undisturbed.reached);
  ASSERT_GE(undisturbed.pushes.size(), 3u);
  const int half = static_cast<int>(undisturbed.pushes.size()) / 2;
  BlockRobot robot(1);
  const Tried first = explored(robot, options, [&](const Tried& so_far) { return so_far.told < half; });
  ASSERT_EQ(first.found.pushes.size(), static_cast<std::size_t>(half));
  EXPECT_EQ(first.found.message, "stopped on request");
  robot.places = 0;
  const Tried rest = explored(robot, going_on(options), {}, &first.found.recording);
  const Explored& found = rest.found;
  EXPECT_TRUE(found.reached) << found.message;
  EXPECT_EQ(found.pushes.size(), undisturbed.pushes.size());
  EXPECT_EQ(found.recording.pushes.size(), found.pushes.size());
  EXPECT_EQ(names(found).size(), found.pushes.size());
  EXPECT_EQ(robot.places, static_cast<int>(found.pushes.size()) - half) << "nothing is pushed twice";
  EXPECT_EQ(rest.begun, robot.places);
  EXPECT_EQ(rest.told, robot.places + 1) << "and once what the earlier ones come to";
  EXPECT_NEAR(std::log(found.pushes.back().young_moduli.front().value / estimation::true_young_pa), 0, 0.07);
  // Of the earlier ones where they were, how hard they pressed and what they come to together.
  for (int k = 0; k < half; ++k) {
    const ExploredPush &then = first.found.pushes[std::size_t(k)], &now = found.pushes[std::size_t(k)];
    EXPECT_TRUE(now.earlier);
    EXPECT_EQ(now.name, then.name);
    EXPECT_LT((now.plan.candidate.contact_m - then.plan.candidate.contact_m).norm(), 2e-3);
    EXPECT_NEAR(now.report.highest_force_n / then.report.highest_force_n, 1, 0.1);
    EXPECT_EQ(now.young_moduli.empty(), k + 1 < half);
  }
  const double before_pa = first.found.pushes.back().young_moduli.front().value;
  EXPECT_NEAR(std::log(found.pushes[std::size_t(half) - 1].young_moduli.front().value / before_pa), 0, 1e-3);
  EXPECT_FALSE(found.pushes.back().earlier);
}

// The tip is left in the object, where it was: it goes back along the tool before anything else, and the loads that are there count.
TEST(Resume, CutOffInAPushItKeepsItsLoadsAndBacksOut) {
  struct Watched : BlockRobot {
    using BlockRobot::BlockRobot;
    std::vector<Vec3> went_m;
    acquisition::Motion move(const Pose& pose, double speed_m_s) override {
      went_m.push_back(pose.translation());
      return BlockRobot::move(pose, speed_m_s);
    }
  } robot(1);
  const ExploreOptions options = some_pushes();
  const Tried first = explored(robot, options, [&](const Tried& so_far) { return so_far.told < 1 || so_far.steps < 6; });
  ASSERT_EQ(first.found.recording.pushes.size(), 2u);
  const Push& cut = first.found.recording.pushes.back();
  ASSERT_TRUE(is_loaded(cut.steps.back())) << "in the middle of it";
  const Pose tip = robot.read().T_base_tip;
  const Vec3 along = cut.steps.back().loads.front().direction;
  ASSERT_GT((tip.translation() - cut.steps.back().loads.front().contact_m).dot(along), 0);
  robot.went_m.clear();
  const Explored found = explored(robot, going_on(options), {}, &first.found.recording).found;
  double back_m = 0;
  for (const Vec3& place : robot.went_m) {
    const Vec3 went_m = place - tip.translation();
    if (went_m.cross(along).norm() > 1e-9) break;
    EXPECT_LT(went_m.dot(along), -back_m + 1e-9) << "back, piece by piece";
    back_m = -went_m.dot(along);
    if (back_m > options.push.start_distance_m) break;
  }
  EXPECT_GT(back_m, options.push.start_distance_m) << "straight, all the way";
  EXPECT_TRUE(found.reached) << found.message;
  EXPECT_TRUE(found.pushes[1].earlier);
  EXPECT_EQ(found.recording.pushes[1].steps.size(), cut.steps.size());
  EXPECT_EQ(names(found).size(), found.pushes.size());
}

TEST(Resume, StoppedInItsFirstFitItSaysThatNothingWasEstimated) {
  BlockRobot robot(1);
  const Explored first = explored(robot, some_pushes(), [](const Tried& so_far) { return so_far.told < 1; }).found;
  const Explored found = explored(robot, going_on(some_pushes()), {}, &first.recording, [](const Tried&, std::string_view stage) { return stage != "fit"; }).found;
  EXPECT_EQ(found.message, "the pushes of the earlier run are not estimated: stopped on request");
  EXPECT_EQ(found.identified.answer.termination, Termination::cancelled);
  EXPECT_EQ(found.recording.pushes.size(), first.recording.pushes.size());
}

TEST(Resume, WhatIsAtItsGoalOrUsedUpIsNotPushedAgain) {
  ExploreOptions options = loop_options();
  BlockRobot robot(1);
  const Explored first = explored(robot, options).found;
  ASSERT_TRUE(first.reached);
  robot.places = 0;
  const Explored again = explored(robot, going_on(options), {}, &first.recording).found;
  EXPECT_TRUE(again.reached);
  EXPECT_EQ(again.message, "both intervals are as narrow as was asked for");
  EXPECT_EQ(again.pushes.size(), first.pushes.size());
  options.young_modulus_within = 1e-4;
  options.max_pushes = static_cast<int>(first.pushes.size());
  EXPECT_EQ(explored(robot, going_on(options), {}, &first.recording).found.message, "all pushes are used up");
  EXPECT_EQ(robot.places, 0);
}

TEST(Resume, APushThatFoundNothingCountsAndItsPlaceIsNotTriedAgain) {
  ExploreOptions options = loop_options();
  options.max_pushes = 1;
  options.young_modulus_within = 1e-4;
  BlockRobot robot(1);
  const Explored first = explored(robot, options).found;
  ASSERT_EQ(first.pushes.size(), 1u);
  Recording recorded = first.recording;
  recorded.pushes[0].steps.resize(1);  // the look before it
  recorded.pushes[0].name = "push 7";
  options.max_pushes = 2;
  const Explored found = explored(robot, going_on(options), {}, &recorded).found;
  EXPECT_EQ(found.fruitless, 1);
  ASSERT_EQ(found.pushes.size(), 1u);
  EXPECT_EQ(found.pushes[0].name, "push 8");
  const auto &then = first.pushes[0].plan.candidate, &now = found.pushes[0].plan.candidate;
  EXPECT_GT((then.contact_m - now.contact_m).norm(), 1e-3);
  options.go_on = false;
  EXPECT_EQ(explored(robot, options, {}, &recorded).found.pushes.at(0).name, "push 1") << "begun anew";
}

}  // namespace
}  // namespace palpate::resume_test
