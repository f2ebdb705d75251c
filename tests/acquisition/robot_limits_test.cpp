// label: unit
// SPDX-License-Identifier: Apache-2.0
// What the robot itself bears, whatever the push asks for, and what it looks at before anybody touches the object.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "acquisition/spring_robot.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition::robot_limits_test {
namespace {

using testing::HasSubstr;

struct LimitedRobot : SpringRobot {
  RobotLimits bears;
  double fastest_m_s = 0;
  RobotLimits limits() const override { return bears; }
  Motion move(const Pose& pose, double speed_m_s) override {
    fastest_m_s = std::max(fastest_m_s, speed_m_s);
    return SpringRobot::move(pose, speed_m_s);
  }
};

double top_n(const Result& result) {
  double top = 0;
  for (const Step& step : result.push.steps) top = std::max(top, force(step));
  return top;
}

TEST(RobotLimits, TheLowerForceEndsThePushAndIsNamed) {
  for (const double bears_n : {3.0, 5.5, 7.9}) {
    LimitedRobot robot;
    robot.bears.force_n = bears_n;
    const Result result = run(robot);
    EXPECT_EQ(result.report.stop, StopReason::robot_force_limit);
    EXPECT_THAT(result.report.message, HasSubstr("the robot's own limit"));
    EXPECT_THAT(result.report.message, HasSubstr("8 N were asked for"));
    EXPECT_NEAR(top_n(result), bears_n, 0.4) << "a step is recorded there";
    EXPECT_LT(robot.highest_n, bears_n + 0.4);
    EXPECT_TRUE(result.push.steps.back().unloading && result.push.steps.back().loads.empty()) << "it went back and looked again";
    int back = 0;
    for (const Step& step : result.push.steps) back += step.unloading && !step.loads.empty();
    EXPECT_EQ(back, options().unloading_steps) << "step by step, as from any limit";
  }
  LimitedRobot strong;
  strong.bears.force_n = 8;  // as much as is asked for
  const Result result = run(strong);
  EXPECT_EQ(result.report.stop, StopReason::force_limit);
  EXPECT_EQ(result.report.message, "the force reached its limit");
}

TEST(RobotLimits, TheLowerTravelEndsThePushAndIsNamed) {
  LimitedRobot robot;
  robot.bears.travel_m = 0.006;
  const Result result = run(robot);
  EXPECT_EQ(result.report.stop, StopReason::robot_travel_limit);
  EXPECT_THAT(result.report.message, HasSubstr("the robot's own limit of 6 mm; 30 mm were asked for"));
  EXPECT_NEAR(result.report.deepest_m, 0.006, 1e-6);
  LimitedRobot far;
  far.bears.travel_m = 0.05;
  PushOptions shallow = options();
  shallow.travel_limit_m = 0.004;
  EXPECT_EQ(run(far, shallow).report.stop, StopReason::travel_limit);
}

TEST(RobotLimits, NoMotionIsFasterThanTheRobotBears) {
  LimitedRobot robot;
  robot.bears.speed_m_s = 0.004;
  EXPECT_EQ(run(robot).report.stop, StopReason::force_limit);
  EXPECT_EQ(robot.fastest_m_s, 0.004);
}

TEST(RobotLimits, WhatGoesOnEndsAtThemToo) {
  LimitedRobot robot;
  robot.bears.force_n = 5;
  Push whole = run(robot).push;
  ASSERT_GT(whole.steps.size(), 3u);
  Push cut = whole;
  cut.steps.resize(2);  // rest, 2 N
  LimitedRobot later;
  later.bears.force_n = 5;
  later.clock_s = robot.clock_s + 60;
  const Result rest = run(later, options(), {}, &cut);
  EXPECT_EQ(rest.report.stop, StopReason::robot_force_limit);
  EXPECT_EQ(rest.push.steps.size() + 2, whole.steps.size());
  EXPECT_LT(later.highest_n, 5.4);
}

TEST(RobotLimits, ThoseThatCannotBeAreNamedBeforeAnythingMoves) {
  const auto refused = [](RobotLimits limits, const char* field) {
    LimitedRobot robot;
    robot.bears = limits;
    try {
      run(robot);
      ADD_FAILURE() << field;
    } catch (const Error& error) {
      EXPECT_EQ(error.where(), std::string("RobotLimits.") + field);
    }
    EXPECT_EQ(robot.fastest_m_s, 0);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused({0, 1, 1}, "force_n");
  refused({1, -1, 1}, "travel_m");
  refused({1, 1, nan}, "speed_m_s");
  using enum StopReason;
  for (const StopReason reason : {force_limit, travel_limit, robot_force_limit, robot_travel_limit}) EXPECT_TRUE(is_at_a_limit(reason));
  for (const StopReason reason : {slip, contact_lost, no_contact, robot_limit, obstacle, moved, user}) EXPECT_FALSE(is_at_a_limit(reason));
}

struct LookingRobot : SpringRobot {
  int looked = 0, breaks_at = 100;
  std::optional<DepthFrame> look(int view, int views) override {
    if (view == breaks_at) throw Error("no answer", "camera");
    EXPECT_EQ(view, looked++);
    DepthFrame frame;
    frame.time_s = 10 * view + views;
    return frame;
  }
};

TEST(LookAround, AsksForEveryViewInTurn) {
  LookingRobot robot;
  const auto frames = look_around(robot, 3);
  ASSERT_TRUE(frames);
  ASSERT_EQ(frames->size(), 3u);
  for (int k = 0; k < 3; ++k) EXPECT_EQ((*frames)[std::size_t(k)].time_s, 10 * k + 3);
  EXPECT_FALSE(robot.stopped);
  EXPECT_THROW(look_around(robot, 0), Error);
}

TEST(LookAround, ARobotThatCannotSaysSoAndDoesNotMove) {
  SpringRobot robot;
  EXPECT_FALSE(look_around(robot, 3));
  EXPECT_EQ(robot.clock_s, 0);
}

TEST(LookAround, TheUserAndAFaultStopTheRobot) {
  LookingRobot robot;
  int asked = 0;
  const auto frames = look_around(robot, 5, [&] { return ++asked < 3; });
  ASSERT_TRUE(frames);
  EXPECT_EQ(frames->size(), 2u);
  EXPECT_TRUE(robot.stopped);
  LookingRobot broken;
  broken.breaks_at = 1;
  EXPECT_THROW(look_around(broken, 5), Error);
  EXPECT_TRUE(broken.stopped);
}

}  // namespace
}  // namespace palpate::acquisition::robot_limits_test
