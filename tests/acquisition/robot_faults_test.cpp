// label: unit
// SPDX-License-Identifier: Apache-2.0
// Robots whose driver or hardware is wrong: the force has the wrong sign or frame, the readings stand still, the tip does not follow.
// A push must end before it does harm, whatever its force limit thinks that it sees.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "acquisition/spring_robot.hpp"

namespace palpate::acquisition::robot_faults_test {
namespace {

enum class Fault { none, reversed, sideways, readings_stand, clock_stands, clock_goes_back, does_not_follow, dragged };

struct FaultyRobot : SpringRobot {
  Fault fault = Fault::none;
  double begins_at_m = 0.1;             // height of the tip below which it shows; the surface's, unless said
  double deepest_sent_m = 0;            // below the surface
  Vec3 pull_n = Vec3::Zero();           // on the way out, above pulled_above_m
  double pulled_above_m = 1e9;
  std::optional<RobotState> last;
  std::optional<Pose> held;
  bool is_under_way_out = false;
  int reads = 0;

  bool shows() const { return tip.translation().z() < begins_at_m; }
  RobotState read() override {
    if (++reads > 200000) throw Error("reads for ever", "test");
    RobotState state = SpringRobot::read();
    const Vec3 felt_n = state.force_n - bias_n;
    if (fault == Fault::reversed) state.force_n = bias_n - felt_n;
    if (fault == Fault::sideways) state.force_n = bias_n + Vec3(felt_n.z(), felt_n.x(), felt_n.y());
    if (fault == Fault::dragged && shows()) state.force_n.x() += 4 * spring();
    if (held) state.T_base_tip = *held;
    is_under_way_out = is_under_way_out || spring() > 2;
    if (is_under_way_out && tip.translation().z() > pulled_above_m) state.force_n += pull_n;
    if (fault == Fault::readings_stand && shows() && last) return *last;
    if (fault == Fault::clock_stands && shows() && last) state.time_s = last->time_s;
    if (fault == Fault::clock_goes_back && shows() && last) state.time_s = last->time_s - 1;
    last = state;
    return state;
  }
  Motion move(const Pose& pose, double speed_m_s) override {
    deepest_sent_m = std::max(deepest_sent_m, surface_m - pose.translation().z());
    if (fault == Fault::does_not_follow && pose.translation().z() < begins_at_m) {
      clock_s += 0.1;
      if (!held) held = tip;
      return Motion::done;
    }
    held.reset();
    return SpringRobot::move(pose, speed_m_s);
  }
};

FaultyRobot stiff(Fault fault) {
  FaultyRobot robot;
  robot.fault = fault;
  robot.stiffness_n_m = 5000;
  robot.relaxation = 0;
  return robot;
}

TEST(RobotFaults, AForceOfTheWrongSignIsNoFreeAir) {
  FaultyRobot robot = stiff(Fault::reversed);
  const Result result = run(robot);
  EXPECT_EQ(result.report.stop, StopReason::obstacle) << result.report.message;
  EXPECT_THAT(result.report.message, testing::HasSubstr("is its sign right?"));
  EXPECT_LT(robot.highest_n, 5) << "two motions of 2.5 N; the limit of 8 N would not have been seen";
  EXPECT_GT(result.report.highest_force_n, 0.5);
  EXPECT_LT(robot.depth(), -0.04) << "it went back";
}

TEST(RobotFaults, AForceInAnotherFrameIsNoFreeAir) {
  FaultyRobot robot = stiff(Fault::sideways);
  const Result result = run(robot);
  EXPECT_EQ(result.report.stop, StopReason::obstacle) << result.report.message;
  EXPECT_THAT(result.report.message, testing::HasSubstr("across the push"));
  EXPECT_LT(robot.highest_n, 5);
  EXPECT_LT(robot.depth(), -0.04);
}

TEST(RobotFaults, ReadingsThatStandStillEndThePush) {
  for (const Fault fault : {Fault::readings_stand, Fault::clock_stands}) {
    for (const double height_m : {0.12, 0.0995}) {  // in free air, and where it presses
      FaultyRobot robot = stiff(fault);
      robot.stiffness_n_m = 400;
      robot.begins_at_m = height_m;
      try {
        run(robot);
        ADD_FAILURE() << "went on at " << height_m;
      } catch (const Error& error) {
        EXPECT_THAT(error.what(), testing::HasSubstr("time_s: stands at"));
      }
      EXPECT_LT(robot.deepest_sent_m, std::max(0.0, 0.1 - height_m) + 0.002);
      EXPECT_LT(robot.depth(), -0.04) << "and it goes back all the same";
    }
  }
}

TEST(RobotFaults, AClockThatGoesBackIsSaid) {
  FaultyRobot robot = stiff(Fault::clock_goes_back);
  try {
    run(robot);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("the clock must not go back"));
  }
}

// What is sent on and on while something holds the tip, is where it jumps to when it comes free.
TEST(RobotFaults, ATipThatDoesNotFollowIsNotSentOn) {
  for (const double height_m : {0.13, 0.098}) {  // on its way, and under load
    FaultyRobot robot = stiff(Fault::does_not_follow);
    robot.stiffness_n_m = 400;
    robot.begins_at_m = height_m;
    PushOptions o = options();
    o.travel_limit_m = 0.005;
    const Result result = run(robot, o);
    EXPECT_EQ(result.report.stop, StopReason::robot_limit) << result.report.message;
    EXPECT_THAT(result.report.message, testing::HasSubstr("behind where it was sent"));
    EXPECT_LE(robot.deepest_sent_m, height_m > 0.1 ? 0 : 0.0095) << "the limit, and what encoders err by";
  }
}

// A wrist that is dragged aside bears no more than what friction at the limit would do to it.
TEST(RobotFaults, WhatDragsAsideCountsAgainstTheLimit) {
  FaultyRobot robot = stiff(Fault::dragged);
  robot.stiffness_n_m = 400;
  robot.begins_at_m = 0.0965;
  PushOptions o = options();
  o.slip.friction_limit = 1;
  o.slip.least_force_n = 100;  // nobody looks for a slip
  const Result result = run(robot, o);
  EXPECT_EQ(result.report.stop, StopReason::slip) << result.report.message;
  EXPECT_THAT(result.report.message, testing::HasSubstr("dragged aside"));
  EXPECT_LT(robot.highest_n, 3.5);
}

// A cable that is caught pulls at the hand: the object is no free way.
TEST(RobotFaults, WhatIsMetOnTheWayOutDoesNotDriveTheTipBackIn) {
  FaultyRobot robot = stiff(Fault::none);
  robot.stiffness_n_m = 400;
  robot.pulled_above_m = 0.135;
  robot.pull_n = Vec3(1.5, 0, 0);
  const Result result = run(robot);
  EXPECT_EQ(result.report.stop, StopReason::obstacle) << result.report.message;
  EXPECT_LT(robot.depth(), -0.005) << "clear of the object";
}

TEST(RobotFaults, ASensorThatIsSlowIsWaitedFor) {
  struct SlowRobot : SpringRobot {
    std::optional<RobotState> last;
    RobotState read() override {
      if (!last || clock_s - last->time_s > 0.1) last = SpringRobot::read();
      return *last;
    }
  };
  SlowRobot robot;
  const Result result = run(robot);
  EXPECT_EQ(result.report.stop, StopReason::force_limit) << result.report.message;
  ASSERT_EQ(result.push.steps.size(), 8u);
  EXPECT_LT(robot.highest_n, 8.8);
}

}  // namespace
}  // namespace palpate::acquisition::robot_faults_test
