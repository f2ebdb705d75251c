// label: unit
// SPDX-License-Identifier: Apache-2.0
// What goes wrong in a lab: an arm that yields, an object that slides away, a force that creeps. Each is as large as its
// option says, and something notices it.
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/lab/robot.hpp"
#include "refusals.hpp"

namespace palpate::lab::mishaps_test {
namespace {

LabObject small_ball() {
  ObjectOptions options;
  options.young_modulus_pa = 15e3;
  options.poisson_ratio = 0.3;
  options.material = "linear";
  options.tetrahedra = 800;
  options.cells_in_radius = 1;
  return make_object("ball", options);
}

LabOptions quiet() {
  LabOptions options;
  options.seed = 2;
  options.joint_std_rad = 0;
  options.force.sigma_n = 0.01;
  options.relaxation = 0;
  return options;
}

void go(LabRobot& robot, const acquisition::PushPlan& plan, double beyond_m) {
  Pose pose = Pose::Identity();
  pose.linear() = plan.R_base_tip;
  const Vec3 off_m = robot.read().T_base_tip.translation() - plan.contact_m;
  if ((off_m - plan.direction.dot(off_m) * plan.direction).norm() > 0.01) {  // along the push's line: the object is in any other way
    pose.translation() = plan.contact_m - 0.05 * plan.direction;
    ASSERT_EQ(robot.move(pose, 0.1), acquisition::Motion::done);
  }
  pose.translation() = plan.contact_m + beyond_m * plan.direction;
  ASSERT_EQ(robot.move(pose, 0.1), acquisition::Motion::done);
}

double along_of_tip(const acquisition::RobotState& state, const acquisition::PushPlan& plan) {
  return plan.direction.dot(state.T_base_tip.translation() - plan.contact_m);
}

TEST(Mishaps, AYieldingArmStaysBehindItsEncodersByForceTimesCompliance) {
  LabOptions options = quiet();
  options.compliance_m_per_n = 8e-4;
  LabRobot yielding(options, small_ball()), stiff(quiet(), small_ball());
  const auto plan = yielding.plan(0);
  stiff.plan(0);
  go(yielding, plan, 0.006);
  EXPECT_GT(yielding.true_force_n(), 1);
  EXPECT_NEAR(yielding.true_travel_m() + 8e-4 * yielding.true_force_n(), 0.006, 1e-5);
  go(stiff, plan, 0.006);
  EXPECT_NEAR(stiff.true_travel_m(), 0.006, 1e-5);
  EXPECT_GT(stiff.true_force_n(), 1.1 * yielding.true_force_n());
  EXPECT_NEAR(along_of_tip(yielding.read(), plan), 0.006, 1e-5) << "the encoders know nothing of it";
  EXPECT_EQ(yielding.scene().tools[0].compliance_m_per_n, 8e-4);
  options.stated_compliance_m_per_n = 0;
  options.stated_compliance_std_m_per_n = 5e-4;
  const Tool stated = LabRobot(options, small_ball()).scene().tools[0];
  EXPECT_EQ(stated.compliance_m_per_n, 0);
  EXPECT_EQ(stated.compliance_std_m_per_n, 5e-4);
}

TEST(Mishaps, AnObjectThatSlidesBearsNoMoreThanFrictionAndIsSeenToHaveMoved) {
  acquisition::PushOptions protocol;
  protocol.travel_limit_m = 0.009;
  protocol.force_step_n = 1;
  protocol.unloading_steps = 0;
  for (const bool slides : {false, true}) {
    LabOptions options = quiet();
    if (slides) options.slides_at_n = 0.8;
    LabRobot robot(options, small_ball());
    const auto plan = robot.plan(1);  // slanted: half of its force is sideways
    double most_n = 0;
    const auto report = acquisition::run_push(robot, plan, protocol, [&](const Push&, const Step&) { most_n = std::max(most_n, robot.true_force_n()); });
    EXPECT_GE(report.steps, 3);
    EXPECT_EQ(report.came_back, !slides) << report.changed_share;
    if (slides) {
      EXPECT_NEAR(most_n * plan.direction.head<2>().norm(), 0.8, 1e-3);
      go(robot, plan, 0.001);
      EXPECT_EQ(robot.true_force_n(), 0) << "its old place is empty";
    } else {
      EXPECT_GT(most_n * plan.direction.head<2>().norm(), 1.2);
    }
  }
}

// What the camera sees of a tip that slid off: the object back where it bears two fifths of the force, and a stick that stands aside.
TEST(Mishaps, ASlipIsInThePicture) {
  LabOptions options = quiet();
  options.depth.noise = {"constant", 1e-6, 0};
  options.depth.flying_pixel_share = 0;
  options.depth.depth_unit_m = 0;
  options.camera_std_m = options.camera_std_rad = 0;
  LabRobot held(options, small_ball());
  options.slip_at_m = 0.004;
  LabRobot slid(options, small_ball());
  const auto plan = held.plan(0);
  slid.plan(0);
  go(held, plan, 0.008);
  go(slid, plan, 0.008);
  EXPECT_NEAR(slid.true_force_n(), 0.4 * held.true_force_n(), 1e-6);
  const DepthFrame before = held.take_depth_image(), after = slid.take_depth_image();
  // Where the other one bears that force, the ball looks the same but for the stick before it.
  double low = 0, high = 0.008;
  for (int k = 0; k < 40; ++k) {
    go(held, plan, 0.5 * (low + high));
    (held.true_force_n() < slid.true_force_n() ? low : high) = 0.5 * (low + high);
  }
  const DepthFrame alike = held.take_depth_image();
  const auto differing = [](const DepthFrame& a, const DepthFrame& b) {
    return ((a.depth_m - b.depth_m).array().abs() > 2e-4F && a.mask.array() == 0 && b.mask.array() == 0).count();
  };
  EXPECT_GT(differing(before, after), 500);
  EXPECT_LT(differing(alike, after), differing(before, after) / 5);
  // The encoders know of the slide, the stick stands there.
  EXPECT_GT(((alike.depth_m - after.depth_m).array().abs() > 0.02F).count(), 200);
}

TEST(Mishaps, AForceThatCreepsIsReported) {
  LabOptions options = quiet();
  options.relaxation = 0.9;
  options.relaxation_s = 10;
  LabRobot robot(options, small_ball());
  acquisition::PushOptions protocol;
  protocol.travel_limit_m = 0.012;
  protocol.force_step_n = 4;
  protocol.increment_m = 0.004;  // about 1.2 N, of which 1 N fades at first by 0.1 N a second; less than a step, so not shortened
  protocol.settling_timeout_s = 4;
  protocol.unloading_steps = 0;
  EXPECT_FALSE(acquisition::run_push(robot, robot.plan(0), protocol, {}).unsettled.empty());
}

TEST(Mishaps, BadOptionsAreNamed) {
  const auto refused = [](auto change) { return refuses([](const LabOptions& o) { check(o); }, quiet(), change); };
  using O = LabOptions;
  EXPECT_FALSE(refused([](O&) {}));
  EXPECT_TRUE(refused([](O& o) { o.slip_at_m = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.compliance_m_per_n = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.stated_compliance_m_per_n = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.stated_compliance_std_m_per_n = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.slides_at_n = 0; }));
}

}  // namespace
}  // namespace palpate::lab::mishaps_test
