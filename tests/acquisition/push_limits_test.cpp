// label: unit
// SPDX-License-Identifier: Apache-2.0
// Limits that hold whatever the object is: the lengths of motions on stiff and on soft springs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "acquisition/spring_robot.hpp"

namespace palpate::acquisition::push_limits_test {
namespace {

TEST(PushProtocol, TheStepAtTheLimitIsRecordedHoweverLowThatIs) {
  for (const double limit_n : {0.4, 1.0, 1.9, 2.0, 3.0}) {
    SpringRobot robot;
    PushOptions o = options();
    o.force_limit_n = limit_n;
    const Result result = run(robot, o);
    EXPECT_EQ(result.report.stop, StopReason::force_limit);
    std::vector<double> loaded_n, back_n;
    for (const Step& step : result.push.steps)
      if (!step.loads.empty()) (step.unloading ? back_n : loaded_n).push_back(force(step));
    ASSERT_EQ(loaded_n.size(), limit_n > 2 ? 2u : 1u) << limit_n;
    EXPECT_NEAR(loaded_n.back(), limit_n, 0.15 * limit_n + 0.05);
    for (const double f : back_n) EXPECT_LT(f, loaded_n.back());
    EXPECT_LT(result.report.overshoot_n, 0.25) << "an increment and noise";
  }
  for (const double limit_m : {0.0004, 0.002}) {
    SpringRobot robot;
    PushOptions o = options();
    o.travel_limit_m = limit_m;
    const Result result = run(robot, o);
    EXPECT_EQ(result.report.stop, StopReason::travel_limit);
    int loaded = 0;
    for (const Step& step : result.push.steps) loaded += !step.loads.empty() && !step.unloading;
    EXPECT_EQ(loaded, 1) << limit_m;
  }
}

// One increment is 50 N here. The first touch may come anywhere within one.
TEST(PushProtocol, AStiffContactIsPressedNoFurtherThanTheLimit) {
  for (const double stiffness_n_m : {5e3, 2e4, 1e5}) {
    for (int k = 0; k < 25; ++k) {
      SpringRobot robot;
      robot.stiffness_n_m = stiffness_n_m;
      robot.surface_m = 0.1 - 2e-5 * k;
      robot.relaxation = 0;
      robot.sigma_m = 2e-5;
      const Result result = run(robot);
      ASSERT_EQ(result.report.stop, StopReason::force_limit) << result.report.message;
      const double touch_n = stiffness_n_m * 5e-4, shortest_n = stiffness_n_m * 1e-5;
      EXPECT_LE(robot.highest_n, std::max(touch_n, 8 + 0.8 + shortest_n) + 1e-9) << stiffness_n_m << " " << k;
      EXPECT_NEAR(result.report.overshoot_n, robot.highest_n > 8.1 ? robot.highest_n - 8 : 0, 0.2) << "and it is said";
      std::vector<double> loaded_n, back_n;
      for (const Step& step : result.push.steps) {
        if (step.loads.empty()) continue;
        (step.unloading ? back_n : loaded_n).push_back(force(step));
        const double travel_m = std::get<ToolTravel>(step.observations.front()).travel_m;
        EXPECT_NEAR(travel_m, force(step) / stiffness_n_m, 6e-5) << "a quarter of what is stated, " << stiffness_n_m << " " << k;
      }
      EXPECT_NEAR(loaded_n.back(), 8, 0.8 + shortest_n) << "settled at the limit, not beyond";
      if (shortest_n > 0.5) continue;  // half a step in the shortest of all motions
      ASSERT_EQ(loaded_n.size(), 4u) << stiffness_n_m << " " << k;
      for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(loaded_n[i], 2 * (double(i) + 1) + 0.5, 0.6) << stiffness_n_m << " " << k;
      EXPECT_EQ(back_n.size(), 2u) << stiffness_n_m << " " << k;
    }
  }
}

TEST(PushProtocol, EndsEvenWhereTheShortestMotionPassesTheLimit) {
  for (int k = 0; k < 50; ++k) {
    SpringRobot robot;
    robot.stiffness_n_m = 5e5;
    robot.surface_m = 0.1 - 1e-5 * k;
    PushOptions o = options();
    o.force_limit_n = 2.5;
    int asked = 0;
    const Result result = run(robot, o, [&] { return ++asked < 20000; });
    ASSERT_EQ(result.report.stop, StopReason::force_limit) << k << ": " << result.report.message;
    EXPECT_GT(result.report.overshoot_n, 0);
  }
}

// The soft cover of something hard: only the motion that meets it goes beyond the limit, and the tip does not stay there.
TEST(PushProtocol, WhereNothingAnnouncedTheForceItIsTakenBackAndSaid) {
  struct Hard : SpringRobot {
    RobotState read() override {
      RobotState state = SpringRobot::read();
      state.force_n.z() -= 1e5 * std::max(0.0, depth() - 0.0101);
      return state;
    }
  } hard;
  const Result result = run(hard);
  EXPECT_EQ(result.report.stop, StopReason::force_limit);
  EXPECT_NEAR(result.report.overshoot_n, result.report.highest_force_n - 8, 1e-9);
  EXPECT_GT(result.report.overshoot_n, 10);
  double top_n = 0;
  for (const Step& step : result.push.steps) top_n = std::max(top_n, force(step));
  EXPECT_NEAR(top_n, 8, 1.3);
}

// Contact is noticed late; where no step under load has told where the force began, the limit holds from there all the same.
TEST(PushProtocol, TheTravelLimitHoldsFromTheFirstTouch) {
  for (const double limit_m : {0.001, 0.0015, 0.003, 0.006})
    for (unsigned seed = 1; seed <= 40; ++seed) {
      SpringRobot robot;
      robot.generator.seed(seed);
      robot.surface_m = 0.1 - 1.3e-5 * seed;
      PushOptions o = options();
      o.travel_limit_m = limit_m;
      o.force_step_n = seed % 2 == 0 ? 2 : 100;  // a step before the limit, at 5 mm, or none
      const double surface_m = robot.surface_m;
      double deepest_m = 0;
      const PushReport report = run_push(robot, plan(), o, [&](const Push&, const Step& step) {
        deepest_m = std::max(deepest_m, surface_m - step.T_base_tip->translation().z());
      });
      ASSERT_EQ(report.stop, StopReason::travel_limit) << report.message;
      // Nothing is known of an object before its force is beyond the threshold: 0.3 N are 0.75 mm, and the motion may be at its end.
      const double touched_m = 0.3 / robot.stiffness_n_m + o.increment_m;
      EXPECT_LE(deepest_m, std::max(limit_m, touched_m) + 0.5 * o.increment_m) << limit_m << " " << seed;
      EXPECT_GE(deepest_m, limit_m - 1.5 * o.increment_m) << "nor long before";
      EXPECT_LE(report.deepest_m, std::max(limit_m, touched_m) + 0.5 * o.increment_m) << "as it is told";
    }
}

// An arm that errs by several force steps a motion still records what it reached.
TEST(PushProtocol, AStiffContactUnderAnArmThatErrsIsRecordedToo) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    SpringRobot robot;
    robot.generator.seed(seed);
    robot.stiffness_n_m = 2e4;
    robot.repeat_std_m = 3e-4;
    robot.relaxation = 0;
    const Result result = run(robot);
    if (result.report.stop != StopReason::force_limit) continue;  // lost again by an error: said
    double top_n = 0;
    for (const Step& step : result.push.steps) top_n = std::max(top_n, force(step));
    EXPECT_GT(top_n, 7.8) << seed;
    EXPECT_NEAR(result.report.overshoot_n, std::max(0.0, robot.highest_n - 8), 0.2) << seed;
  }
}

TEST(PushProtocol, SoftObjectsAreFeltEveryIncrement) {
  std::vector<double> depths_m;
  struct Watched : SpringRobot {
    std::vector<double>* out = nullptr;
    bool passing = false;
    void on_the_way(bool is) override { passing = is; }
    Motion move(const Pose& pose, double speed_m_s) override {
      if (!passing) out->push_back(surface_m - pose.translation().z());
      return SpringRobot::move(pose, speed_m_s);
    }
  } watched;
  watched.out = &depths_m;
  EXPECT_LT(run(watched).report.overshoot_n, 0.25);
  ASSERT_GT(depths_m.size(), 100u);
  for (std::size_t i = 2; i + 1 < depths_m.size(); ++i) EXPECT_NEAR(std::abs(depths_m[i] - depths_m[i - 1]), options().increment_m, 1e-9) << i;
}

}  // namespace
}  // namespace palpate::acquisition::push_limits_test
