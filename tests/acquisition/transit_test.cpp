// label: unit
// SPDX-License-Identifier: Apache-2.0
// The way from one push to the next: around the object, in short pieces, with an eye on the force.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <vector>

#include "acquisition/spring_robot.hpp"
#include "palpate/acquisition/keep_out.hpp"
#include "palpate/acquisition/ways_around.hpp"

namespace palpate::acquisition::transit_test {
namespace {

// A tip in free air around a box of 0.2 m at the origin's table, without gravity: it feels the box, and whatever else stands there.
struct FreeRobot : Robot {
  KeepOut box{Vec3(-0.1, -0.1, 0), Vec3(0.1, 0.1, 0.2), {Plane{}}};
  std::optional<KeepOut> other;
  Pose tip = Pose::Identity();
  std::vector<Pose> way{};
  double clock_s = 0, longest_m = 0;
  int stops = 0;
  bool underway = false, arrived = false;
  Vec3 bias_n{0.3, -2, 1};
  Mat3 R_base_bias = Mat3::Identity();  // the bias turns with the hand

  RobotState read() override {
    RobotState state;
    state.time_s = clock_s;
    state.T_base_tip = tip;
    state.force_n = tip.linear() * bias_n + Vec3(0, 0, -3);
    for (const KeepOut* one : {&box, other ? &*other : nullptr})
      if (one != nullptr && passes_through(*one, tip.translation(), tip.translation())) state.force_n += Vec3(0, 6, 0);
    return state;
  }
  Motion move(const Pose& pose, double speed_m_s) override {
    const double length_m = (pose.translation() - tip.translation()).norm();
    longest_m = std::max(longest_m, length_m);
    clock_s += length_m / speed_m_s;
    tip = pose;
    way.push_back(pose);
    return Motion::done;
  }
  void stop() override { ++stops; }
  void on_the_way(bool is) override {
    arrived = underway && !is;
    underway = is;
  }
  DepthFrame take_depth_image() override { return {}; }
  void wait(double duration_s) override { clock_s += duration_s; }
  double travel_sigma_m() const override { return 1e-4; }
};

PushPlan plan_at(const Vec3& contact_m, const Vec3& direction) {
  PushPlan plan;
  plan.name = "push 1";
  plan.tool = "stick";
  plan.contact_m = contact_m;
  plan.direction = direction.normalized();
  plan.R_base_tip = tip_along(plan.direction);
  return plan;
}

const std::vector<PushPlan>& plans() {
  static const std::vector<PushPlan> all{
      plan_at({0, 0, 0.2}, {0, 0, -1}),       plan_at({-0.1, 0, 0.1}, {1, 0, 0}),     plan_at({0.1, 0, 0.05}, {-1, 0, 0}),
      plan_at({0.02, -0.1, 0.1}, {0, 1, -0.6}), plan_at({0, 0.1, 0.15}, {0.3, -1, 0}), plan_at({0.05, 0.05, 0.2}, {0.3, 0.3, -1})};
  return all;
}

Pose before(const PushPlan& plan, double distance_m) {
  Pose pose = Pose::Identity();
  pose.linear() = plan.R_base_tip;
  pose.translation() = plan.contact_m - distance_m * plan.direction;
  return pose;
}

PushReport come(FreeRobot& robot, const PushPlan& plan) {
  return run_push(robot, plan, PushOptions{}, {}, [&] { return !robot.arrived; });
}

TEST(Transit, TheTipAndTheToolGoAroundTheObject) {
  const PushOptions o;
  int crossed = 0;
  for (const PushPlan& from : plans())
    for (const PushPlan& to : plans()) {
      if (&from == &to) continue;
      FreeRobot robot;
      robot.tip = before(from, o.start_distance_m);
      crossed += passes_through(robot.box, robot.tip.translation(), before(to, o.start_distance_m).translation());
      PushPlan plan = to;
      plan.around = robot.box;
      const PushReport report = come(robot, plan);
      ASSERT_EQ(report.stop, StopReason::user) << report.message;
      ASSERT_TRUE(robot.tip.isApprox(before(to, o.start_distance_m), 1e-9)) << "it came there";
      EXPECT_FALSE(report.blind_retreat_m);
      EXPECT_LE(robot.longest_m, o.look_every_m + 1e-9);
      Vec3 last_m = before(from, o.start_distance_m).translation();
      const KeepOut box = grown(robot.box, o.clearance_m);
      for (const Pose& pose : robot.way) {
        const Vec3 at_m = pose.translation(), end_m = at_m - o.tool_length_m * pose.linear().col(2);
        EXPECT_FALSE(passes_through(robot.box, last_m, at_m));
        EXPECT_FALSE(passes_through(robot.box, at_m, end_m)) << "the tool behind the tip";
        EXPECT_GE(at_m.z(), 0) << "table";
        const auto is_on = [&](const PushPlan& one) {
          const Vec3 off_m = at_m - one.contact_m;
          return (off_m - off_m.dot(one.direction) * one.direction).norm() < 1e-9;
        };
        EXPECT_TRUE(is_on(from) || is_on(to) || !passes_through(box, last_m, at_m)) << "with its clearance";
        last_m = at_m;
      }
    }
  EXPECT_GT(crossed, 8) << "or nothing had to be gone around";
}

TEST(Transit, StraightWhereNothingIsBetween) {
  FreeRobot robot;
  robot.tip = before(plans()[0], 0.05);
  PushPlan plan = plans()[0];
  plan.contact_m.x() += 0.06;
  plan.around = robot.box;
  come(robot, plan);
  EXPECT_LT(robot.clock_s, 0.06 / PushOptions{}.approach_speed_m_s + 1);
}

TEST(Transit, WhatStandsInTheWayStopsItAndItGoesBack) {
  for (int k = 0; k < 3; ++k) {
    FreeRobot robot;
    robot.tip = before(plans()[1], 0.05);
    robot.other = KeepOut{Vec3(-0.05 + 0.03 * k, -1, 0.0), Vec3(-0.02 + 0.03 * k, 1, 0.6), {}};  // on any way to the other side
    PushPlan plan = plans()[2];
    plan.around = robot.box;
    int recorded = 0;
    const PushReport report = run_push(robot, plan, PushOptions{}, [&](const Push&, const Step&) { ++recorded; });
    ASSERT_EQ(report.stop, StopReason::obstacle) << report.message;
    EXPECT_STREQ(to_words(report.stop), "hit something on the way");
    EXPECT_THAT(report.message, testing::HasSubstr("6 N at"));
    EXPECT_EQ(recorded, 0);
    EXPECT_GE(robot.stops, 1);
    const Vec3 at_m = robot.tip.translation();
    EXPECT_FALSE(passes_through(*robot.other, at_m, at_m)) << "it went back";
    int in_it = 0;
    for (const Pose& pose : robot.way) in_it += passes_through(*robot.other, pose.translation(), pose.translation());
    EXPECT_EQ(in_it, 1) << "one piece of the way";
  }
}

// A threshold for an object of 1 kPa: the arm's repeat error, of which nothing is read, turns the stick's weight by as much.
TEST(Transit, TheSticksOwnWeightIsNoObstacleWhereContactIsFelt) {
  struct Turning : FreeRobot {
    RobotState read() override {
      RobotState state = FreeRobot::read();
      state.force_n = Eigen::AngleAxisd(way.size() % 2 == 1 ? 3e-3 : 0, Vec3::UnitY()) * state.force_n;
      return state;
    }
  };
  for (const double obstacle_n : {PushOptions{}.obstacle_threshold_n, 0.005}) {
    Turning robot;
    robot.tip = before(plans()[1], 0.05);
    PushPlan plan = plans()[2];
    plan.around = robot.box;
    PushOptions soft;
    soft.contact.threshold_n = 0.005;
    soft.obstacle_threshold_n = obstacle_n;
    const PushReport report = run_push(robot, plan, soft, {}, [&] { return !robot.arrived; });
    EXPECT_EQ(report.stop, obstacle_n < 0.1 ? StopReason::obstacle : StopReason::user) << report.message;
  }
}

TEST(Transit, WithoutAShapeItGoesBackAndSaysSo) {
  FreeRobot robot;
  robot.tip = before(plans()[1], 0.05);
  const PushReport report = come(robot, plans()[0]);
  ASSERT_TRUE(report.blind_retreat_m);
  EXPECT_NEAR(*report.blind_retreat_m, PushOptions{}.blind_retreat_m, 1e-9);
  double back_m = 0;
  for (const Pose& pose : robot.way) back_m = std::max(back_m, -0.1 - pose.translation().x());
  EXPECT_NEAR(back_m, 0.05 + PushOptions{}.blind_retreat_m, 1e-9);
  EXPECT_TRUE(robot.tip.isApprox(before(plans()[0], 0.05), 1e-9));
}

TEST(Transit, AWayThatIsRefusedIsLeftForAnother) {
  struct NoSides : FreeRobot {
    Motion move(const Pose& pose, double speed_m_s) override {
      if (std::abs(pose.translation().y()) > 0.13) return Motion::refused;
      return FreeRobot::move(pose, speed_m_s);
    }
  } sides;
  struct NoTop : FreeRobot {
    Motion move(const Pose& pose, double speed_m_s) override {
      if (pose.translation().z() > 0.22) return Motion::refused;
      return FreeRobot::move(pose, speed_m_s);
    }
  } top;
  for (FreeRobot* robot : {static_cast<FreeRobot*>(&sides), static_cast<FreeRobot*>(&top)}) {
    robot->tip = before(plans()[1], 0.05);
    PushPlan plan = plans()[2];
    plan.around = robot->box;
    const PushReport report = come(*robot, plan);
    ASSERT_EQ(report.stop, StopReason::user) << report.message;
    EXPECT_TRUE(robot->tip.isApprox(before(plan, 0.05), 1e-9));
    for (const Pose& pose : robot->way) EXPECT_FALSE(passes_through(robot->box, pose.translation(), pose.translation()));
  }
}

TEST(Transit, TheUserStopsItWithinAPieceOfTheWay) {
  for (const double stop_s : {1.0, 5.0, 20.0}) {
    FreeRobot robot;
    robot.tip = before(plans()[1], 0.05);
    PushPlan plan = plans()[2];
    plan.around = robot.box;
    std::optional<Vec3> asked_at_m;
    const PushReport report = run_push(robot, plan, PushOptions{}, {}, [&] {
      if (robot.clock_s < stop_s) return true;
      asked_at_m = robot.tip.translation();
      return false;
    });
    EXPECT_EQ(report.stop, StopReason::user);
    EXPECT_TRUE(robot.underway || robot.stops > 0);
    ASSERT_TRUE(asked_at_m);
    EXPECT_EQ(robot.tip.translation(), *asked_at_m) << "where it stands";
    const PushOptions o;
    EXPECT_LT(robot.clock_s, stop_s + o.look_every_m / o.approach_speed_m_s + 0.1) << "at once";
  }
}

// A run that was killed has left the tip in the object: that the force falls is no obstacle.
TEST(Transit, APressedTipGoesOutTheWayItCame) {
  SpringRobot robot;
  robot.tip.translation().z() = 0.09;  // 4 N
  const Result result = run(robot);
  EXPECT_EQ(result.report.stop, StopReason::force_limit) << result.report.message;
  EXPECT_NEAR((result.report.tare_n - robot.bias_n).norm(), 0, 0.02);
  SpringRobot elsewhere;  // the next push is another one
  elsewhere.tip.linear() = tip_along(-Vec3::UnitZ());
  elsewhere.tip.translation() = Vec3(0, 0, 0.09);
  PushPlan next = plan();
  next.R_base_tip = elsewhere.tip.linear();
  next.contact_m.x() = 0.05;
  next.around = KeepOut{Vec3(-0.1, -0.1, 0), Vec3(0.1, 0.1, 0.1), {}};
  EXPECT_EQ(run_push(elsewhere, next, options(), {}).stop, StopReason::force_limit);
}

}  // namespace
}  // namespace palpate::acquisition::transit_test
