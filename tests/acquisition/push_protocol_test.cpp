// label: unit
// SPDX-License-Identifier: Apache-2.0
// Every way in which a push can end, on a robot that presses a spring.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "acquisition/spring_robot.hpp"
#include "palpate/core/error.hpp"
#include "refusals.hpp"

namespace palpate::acquisition::push_protocol_test {
namespace {

// Which motion crosses the target is decided by what the encoders do not see of it: its own travel would read too little,
// by 0.17 mm here.
TEST(PushProtocol, StepsAreNotPickedForTheErrorOfTheirTravel) {
  double in_sum = 0, out_sum = 0;
  int in_count = 0, out_count = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    SpringRobot robot;
    robot.repeat_std_m = 3e-4;
    robot.generator.seed(seed);
    PushOptions o = options();
    o.force_step_n = 1;
    o.travel_limit_m = 0.02;
    run_push(robot, plan(), o, [&](const Push&, const Step& step) {
      if (step.loads.empty() || robot.depth() > 0.018) return;  // the deepest is chosen by the encoders
      (step.unloading ? out_sum : in_sum) += robot.unseen_m;
      ++(step.unloading ? out_count : in_count);
    });
  }
  EXPECT_GT(in_count, 600);
  EXPECT_GT(out_count, 300);
  EXPECT_NEAR(in_sum / in_count, 0, 4 * 3e-4 / std::sqrt(in_count));
  EXPECT_NEAR(out_sum / out_count, 0, 4 * 3e-4 / std::sqrt(out_count));
}

TEST(PushProtocol, NoStepIsRecordedTwiceWhereTheObjectStiffens) {
  for (const double limit_n : {8.0, 12.0}) {
    SpringRobot robot;
    robot.stiffens_at_m = 0.01;
    robot.relaxation = 0;
    PushOptions o = options();
    o.force_step_n = 0.5;  // one motion passes several of them
    o.force_limit_n = limit_n;
    const Result result = run(robot, o);
    EXPECT_EQ(result.report.stop, StopReason::force_limit);
    double last_m = 1;
    int steps = 0;
    for (const Step& step : result.push.steps) {
      if (step.loads.empty() || step.unloading) continue;
      EXPECT_LT(step.T_base_tip->translation().z(), last_m - 1e-9);
      last_m = step.T_base_tip->translation().z();
      ++steps;
    }
    EXPECT_GT(steps, 8);
    EXPECT_GT(result.report.highest_force_n, limit_n - 1) << "the top is recorded, once";
  }
}

TEST(PushProtocol, RisesStepByStepToTheForceLimitAndBack) {
  SpringRobot robot;
  const Result result = run(robot);
  EXPECT_EQ(result.report.stop, StopReason::force_limit);
  EXPECT_NEAR((result.report.tare_n - robot.bias_n).norm(), 0, 0.02);
  EXPECT_NEAR(result.report.contact_m.z(), 0.1, 0.002);
  std::vector<double> forces;
  std::vector<bool> unloading;
  double time = -1;
  for (const Step& step : result.push.steps) {
    EXPECT_GT(step.time_s, time);
    time = step.time_s;
    forces.push_back(force(step));
    unloading.push_back(step.unloading);
    EXPECT_EQ(step.joints_rad.size(), 2u);
    const DepthFrame* frame = nullptr;
    const ToolTravel* travel = nullptr;
    for (const Observation& o : step.observations) {
      if (const auto* f = std::get_if<DepthFrame>(&o)) frame = f;
      if (const auto* t = std::get_if<ToolTravel>(&o)) travel = t;
    }
    ASSERT_NE(frame, nullptr);
    EXPECT_EQ(travel != nullptr, !step.loads.empty());
    if (!travel) continue;
    // Force and travel belong together: the spring, with its zero where contact was noticed.
    EXPECT_NEAR(force(step), 400 * (0.1 - step.T_base_tip->translation().z()), 0.1);
    EXPECT_NEAR(travel->travel_m, result.report.contact_m.z() - step.T_base_tip->translation().z(), 1e-12);
    EXPECT_GT(step.loads[0].force_std_n, 0);
    EXPECT_LT(step.loads[0].force_std_n, 0.02);
  }
  ASSERT_EQ(forces.size(), 8u);  // rest, 2, 4, 6, 8 N, two on the way back, rest again
  const std::vector<double> expected{0, 2, 4, 6, 8, 5.4, 2.7, 0};
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(forces[i], expected[i], 0.4) << i;
  EXPECT_THAT(unloading, testing::ElementsAre(false, false, false, false, false, true, true, true));
  EXPECT_TRUE(result.report.unsettled.empty());
  EXPECT_LT(robot.depth(), 0) << "retreated";
}

TEST(PushProtocol, ADriftOfTheSensorIsFoundInTheFreeAirAfterThePush) {
  SpringRobot steady, drifts;
  drifts.drift_n_s = Vec3(0.002, -0.001, 0.004);
  const Result without = run(steady);
  Result made = run(drifts);
  ASSERT_TRUE(without.report.drift && made.report.drift);
  const double duration_s = made.push.steps.back().time_s - made.push.steps.front().time_s;
  const double tare_std_n = 0.02 * std::sqrt(2 * 3 / 50.);
  EXPECT_LT(without.report.drift_n, 4 * tare_std_n);
  EXPECT_LT((made.report.drift->rate_n_s - drifts.drift_n_s).norm() * duration_s, 4 * tare_std_n);
  const Step before = made.push.steps[made.push.steps.size() - 2];
  take_off(*made.report.drift, made.push);
  const Step& after = made.push.steps[made.push.steps.size() - 2];
  ASSERT_EQ(after.loads.size(), 1u);
  const double waited_s = after.time_s - made.report.drift->zero_at_s;
  EXPECT_LT((*before.loads[0].force_n - *after.loads[0].force_n - waited_s * drifts.drift_n_s).norm(), 4 * tare_std_n);
  EXPECT_GT(waited_s * drifts.drift_n_s.norm(), 6 * tare_std_n) << "or it could not be told from noise";
  SpringRobot nothing;
  nothing.surface_m = 0.05;
  EXPECT_TRUE(run(nothing).push.steps.size() == 1 && run(nothing).report.stop == StopReason::no_contact);
}

TEST(PushProtocol, ATipThatTurnsAfterTheTareIsToldOf) {
  SpringRobot keeps, rolls;
  rolls.rolls_rad_m = 2;  // from 5 cm before contact on
  EXPECT_LT(run(keeps).report.turned_rad, 1e-9);
  const Result result = run(rolls);
  EXPECT_NEAR(result.report.turned_rad, 2 * (0.05 + result.report.deepest_m), 0.01);
}

TEST(PushProtocol, WaitsForTheForceToSettleAndSaysWhenItDoesNot) {
  SpringRobot quick, slow;
  quick.relaxation_s = 0.1;
  slow.relaxation = 40;  // of the last 0.2 N: 8 N that take 20 s to fade
  slow.relaxation_s = 20;
  EXPECT_TRUE(run(quick).report.unsettled.empty());
  EXPECT_FALSE(run(slow).report.unsettled.empty());
}

TEST(PushProtocol, StopsAtTheTravelLimit) {
  SpringRobot robot;
  robot.stiffness_n_m = 100;
  const Result result = run(robot);
  EXPECT_EQ(result.report.stop, StopReason::travel_limit);
  EXPECT_NEAR(result.report.deepest_m, 0.03, 1e-6);
  EXPECT_LT(result.report.highest_force_n, 8);
}

// Contact is noticed a millimetre late here: force over travel would come out by half too stiff.
TEST(PushProtocol, AShortTouchOfOneStepTellsTheStiffness) {
  SpringRobot robot;
  PushOptions touch = options();
  touch.travel_limit_m = 0.002;
  touch.force_step_n = touch.force_limit_n = 50;
  const PushReport report = run(robot, touch).report;
  EXPECT_EQ(report.stop, StopReason::travel_limit);
  EXPECT_NEAR(report.highest_force_n / report.deepest_m, robot.stiffness_n_m, 0.15 * robot.stiffness_n_m);
}

TEST(PushProtocol, StopsOnSlip) {
  SpringRobot sideways, gives_way;
  sideways.slips_at_m = 0.009;
  Result result = run(sideways);
  EXPECT_EQ(result.report.stop, StopReason::slip);
  EXPECT_LT(result.report.deepest_m, 0.0101);
  EXPECT_LT(sideways.depth(), 0) << "retreated";
  EXPECT_EQ(result.push.steps.back().loads.size(), 0u) << "looked again";

  gives_way.yields_at_m = 0.009;
  EXPECT_EQ(run(gives_way).report.stop, StopReason::slip);
}

TEST(PushProtocol, StopsWhenContactIsLost) {
  SpringRobot robot;
  robot.loses_at_m = 0.012;
  const Result result = run(robot);
  EXPECT_EQ(result.report.stop, StopReason::contact_lost);
  for (const Step& step : result.push.steps) EXPECT_LE(force(step), 0.012 * 400 + 0.5);
}

// The arm's repeat error took the first touch away again: seen once in a hundred pushes of the software lab.
TEST(PushProtocol, GoesOnWhereTheFirstTouchWasHardlyOne) {
  SpringRobot robot;
  robot.errs_after_touch = 1;
  const Result result = run(robot);
  EXPECT_EQ(robot.errs_after_touch, 0);
  EXPECT_EQ(result.report.stop, StopReason::force_limit) << result.report.message;
  EXPECT_NEAR(result.report.contact_m.z(), 0.1, 1.5e-3);
}

// What was felt in the air before a touch that was lost again still says that nothing was there: the force's rise is not traced back
// past it, and a push is not over by a travel that never was.
TEST(PushProtocol, AfterALostTouchContactIsStillWhereItWasFelt) {
  int lost = 0;
  for (unsigned seed = 1; seed <= 100; ++seed) {
    SpringRobot robot;
    robot.generator.seed(seed);
    robot.stiffness_n_m = 5e3;
    robot.repeat_std_m = 1.5e-4;
    robot.errs_after_touch = 1;
    PushOptions o = options();
    o.travel_limit_m = 0.01;
    const Result result = run(robot, o);
    EXPECT_EQ(robot.errs_after_touch, 0);
    EXPECT_NEAR(result.report.contact_m.z(), 0.1, 1.5e-3) << seed;
    if (result.report.stop == StopReason::contact_lost && ++lost) continue;  // an error of a motion is 0.75 N: lost again and again, and said
    EXPECT_EQ(result.report.stop, StopReason::force_limit) << seed << ": " << result.report.message;
  }
  EXPECT_LT(lost, 30);  // 39 where only touches below a step's force were taken up again
}

TEST(PushProtocol, GivesUpWhereNothingIsTouched) {
  SpringRobot robot;
  robot.surface_m = 0.0;
  const Result result = run(robot);
  EXPECT_EQ(result.report.stop, StopReason::no_contact);
  EXPECT_EQ(result.push.steps.size(), 1u);
}

TEST(PushProtocol, StopsWhereTheRobotRefuses) {
  SpringRobot robot;
  robot.refuses_at_m = 0.011;
  const Result result = run(robot);
  EXPECT_EQ(result.report.stop, StopReason::robot_limit);
  EXPECT_LT(robot.depth(), 0) << "retreated";
  robot.refuses_at_m = -1;  // cannot even get to the start
  EXPECT_EQ(run(robot).report.stop, StopReason::robot_limit);
  EXPECT_TRUE(robot.stopped);
}

TEST(PushProtocol, UserStopsItWhereItIs) {
  SpringRobot robot;
  const Result result = run(robot, options(), [&] { return robot.depth() < 0.006; });
  EXPECT_EQ(result.report.stop, StopReason::user);
  EXPECT_TRUE(robot.stopped);
  EXPECT_NEAR(robot.depth(), 0.006, 0.0011);
}

// Whatever it is at: between the free air before the push and that after it.
TEST(PushProtocol, UserStopsItAtAnyTime) {
  SpringRobot counted;
  int asked = 0;
  const std::size_t whole = run(counted, options(), [&] { return ++asked > 0; }).push.steps.size();
  int at_rest = 0, settling = 0, back = 0, last = 0;
  for (int stop_at = 1; stop_at <= asked; ++stop_at) {
    SpringRobot robot;
    int now = 0;
    double asked_at_m = 0, asked_at_s = 0;
    const Result result = run(robot, options(), [&] {
      asked_at_m = robot.depth();
      asked_at_s = robot.clock_s;
      return ++now < stop_at;
    });
    ASSERT_EQ(result.report.stop, StopReason::user) << stop_at;
    ASSERT_EQ(result.report.message, "stopped on request") << stop_at;
    ASSERT_TRUE(robot.stopped) << stop_at;
    ASSERT_EQ(now, stop_at) << "once is enough";
    ASSERT_EQ(robot.depth(), asked_at_m) << stop_at << ": no motion after it";
    ASSERT_EQ(robot.clock_s, asked_at_s) << stop_at << ": nor anything that takes time";
    ASSERT_LT(result.push.steps.size(), whole);
    at_rest += result.push.steps.empty();
    settling += robot.clock_s - robot.moved_s > 0.1 && robot.depth() > 0;
    if (!result.push.steps.empty()) {
      back += result.push.steps.back().unloading && robot.depth() > 0;
      last += result.push.steps.size() == whole - 1 && robot.depth() < 0;
    }
  }
  EXPECT_GT(at_rest, 10);
  EXPECT_GT(settling, 100);
  EXPECT_GT(back, 20);
  EXPECT_GT(last, 10) << "in the free air after the push";
}

TEST(PushProtocol, UserStopsItWhileItRetreats) {
  SpringRobot robot;
  double stopped_at_m = 0;
  const Result result = run(robot, options(), [&] {
    if (robot.images < 7) return true;  // all but the last
    stopped_at_m = robot.depth();
    return false;
  });
  EXPECT_EQ(result.report.stop, StopReason::user);
  EXPECT_GT(stopped_at_m, 0);
  EXPECT_EQ(robot.depth(), stopped_at_m) << "still pressed, as asked for";
  EXPECT_EQ(result.push.steps.size(), 7u);
}

TEST(PushProtocol, WhateverBreaksTheTipGoesAway) {
  for (const double breaks_m : {-0.01, 0.002, 0.01}) {
    SpringRobot robot;
    robot.breaks_beyond_m = breaks_m;
    EXPECT_THROW(run(robot), Error) << "it goes on to the caller";
    EXPECT_TRUE(robot.stopped);
    EXPECT_NEAR(robot.depth(), -0.052, 1e-3) << breaks_m;
  }
  struct DiskIsFull {};
  for (int kept = 0; kept < 8; ++kept) {
    SpringRobot robot;
    int steps = 0;
    EXPECT_THROW(run_push(robot, plan(), options(), [&](const Push&, const Step&) { if (steps++ == kept) throw DiskIsFull{}; }), DiskIsFull);
    EXPECT_TRUE(robot.stopped);
    EXPECT_NEAR(robot.depth(), -0.052, 1e-3) << kept;
  }
  struct Jams : SpringRobot {
    Motion move(const Pose& pose, double speed_m_s) override {
      if (stopped && surface_m - pose.translation().z() < -0.01) throw Error("jammed", "robot");
      return SpringRobot::move(pose, speed_m_s);
    }
  } jams;
  jams.breaks_beyond_m = 0.006;
  EXPECT_THROW(run(jams), Error);
  EXPECT_LT(jams.depth(), 0.003) << "as far as it goes";
  SpringRobot wanted;
  wanted.breaks_beyond_m = 0.006;
  EXPECT_THROW(run(wanted, options(), [&] { return !wanted.stopped; }), Error);
  EXPECT_NEAR(wanted.depth(), 0.006, 6e-4) << "the user wants it where it is";
}

// Nothing could read a recording that held one.
TEST(PushProtocol, AnImageWithoutADepthIsLeftOutAndItsForceCounts) {
  SpringRobot robot;
  robot.blank_images = 2;
  const Result result = run(robot);
  EXPECT_EQ(result.report.blank_images, 2);
  EXPECT_FALSE(result.report.compared) << "there is none from before";
  ASSERT_EQ(result.push.steps.size(), 8u);
  for (std::size_t i = 0; i < 8; ++i) {
    const auto& seen = result.push.steps[i].observations;
    EXPECT_EQ(std::any_of(seen.begin(), seen.end(), [](const Observation& one) { return std::holds_alternative<DepthFrame>(one); }), i >= 2) << i;
  }
  EXPECT_NEAR(force(result.push.steps[1]), 2, 0.4);
}

TEST(PushProtocol, ACameraThatMovedTellsNothingOfTheObject) {
  SpringRobot stands, moves;
  moves.camera_moves = true;
  const PushReport seen = run(stands).report, unseen = run(moves).report;
  EXPECT_TRUE(seen.compared);
  EXPECT_TRUE(seen.came_back);
  EXPECT_FALSE(unseen.compared);
  EXPECT_TRUE(unseen.came_back) << "nothing speaks against it";
}

TEST(PushProtocol, BadOptionsAndPlansAreRefused) {
  const auto refused = [](auto change) { return refuses([](const auto& o) { check(o); }, options(), change); };
  using O = PushOptions;
  EXPECT_FALSE(refused([](O&) {}));
  EXPECT_TRUE(refused([](O& o) { o.force_limit_n = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.travel_limit_m = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.force_step_n = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.unloading_steps = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.start_distance_m = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.search_distance_m = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.increment_m = 0.02; }));
  EXPECT_TRUE(refused([](O& o) { o.clearance_m = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.tool_length_m = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.look_every_m = 0.1; }));
  EXPECT_TRUE(refused([](O& o) { o.blind_retreat_m = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.approach_speed_m_s = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.push_speed_m_s = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.obstacle_threshold_n = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.sample_period_s = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.free_air_samples = 1; }));
  EXPECT_TRUE(refused([](O& o) { o.settling_timeout_s = 0.1; }));
  EXPECT_TRUE(refused([](O& o) { o.contact_std_m = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.contact.threshold_n = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.settling.rate_n_s = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.slip.tangential_m = 0; }));
  SpringRobot robot;
  PushPlan bad = plan();
  bad.direction = Vec3(0, 0, -2);
  EXPECT_THROW(run_push(robot, bad, options(), {}), Error);
  bad = plan();
  bad.tool.clear();
  EXPECT_THROW(run_push(robot, bad, options(), {}), Error);
}

}  // namespace
}  // namespace palpate::acquisition::push_protocol_test
