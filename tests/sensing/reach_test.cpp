// label: unit
// SPDX-License-Identifier: Apache-2.0
// An arm of three joints in one plane, whose reach is known in closed form: the wrist lies one hand behind the tip, and two
// links get to it with the elbow on one side or on the other.
#include "palpate/sensing/reach.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "palpate/core/error.hpp"
#include "palpate/sensing/arm_reach.hpp"

namespace palpate::sensing::reach_test {
namespace {

constexpr double upper_m = 0.4, fore_m = 0.3, hand_m = 0.1;

Pose at(double x, double y, double z) { return Pose(Eigen::Translation3d(x, y, z)); }

/// Turns about y in the plane of x and z; every link lies along its own x, the hand's tip looks along it.
RobotModel three_joints(double elbow_from, double elbow_to) {
  RobotModel robot;
  for (const char* name : {"base", "upper", "fore", "hand"}) robot.links.push_back({name, {}, {}});
  const auto joint = [&](const char* name, int parent, double along_m, double from, double to) {
    RobotJoint j;
    j.kind = RobotJoint::Kind::revolute;
    j.name = name;
    j.parent = robot.links[static_cast<std::size_t>(parent)].name;
    j.child = robot.links[static_cast<std::size_t>(parent) + 1].name;
    j.T_parent_joint = at(along_m, 0, 0);
    j.axis = Vec3::UnitY();
    j.lower = from;
    j.upper = to;
    robot.joints.push_back(j);
  };
  joint("shoulder", 0, 0, -3.1, 3.1);
  joint("elbow", 1, upper_m, elbow_from, elbow_to);
  joint("wrist", 2, fore_m, -3.1, 3.1);
  RobotShape rod;
  rod.kind = RobotShape::Kind::box;
  rod.size_m = Vec3(fore_m, 0.02, 0.02);
  rod.T_link_shape = at(0.5 * fore_m, 0, 0);
  robot.links[2].visual = {rod};
  return robot;
}

Pose tip_on_hand() {
  Pose pose = at(hand_m, 0, 0);
  pose.linear() = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), Vec3::UnitX()).toRotationMatrix();
  return pose;
}

Pose looking(const Vec3& point_m, const Vec3& along) {
  Pose pose = Pose::Identity();
  pose.translation() = point_m;
  pose.linear() = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), along).toRotationMatrix();
  return pose;
}

/// Elbow angle of one of the two ways to the wrist; nothing where it is too near or too far.
std::optional<double> elbow(const Vec3& tip_m, const Vec3& along, double side) {
  const double squared = (tip_m - hand_m * along).squaredNorm();
  const double cosine = (squared - upper_m * upper_m - fore_m * fore_m) / (2 * upper_m * fore_m);
  if (std::abs(cosine) > 1) return std::nullopt;
  return side * std::acos(cosine);
}

TEST(Reach, AgreesWithTheClosedFormOfThreeJoints) {
  const double from = -0.3, to = 2.2;
  const Kinematics kinematics(three_joints(from, to));
  ReachOptions options;
  options.T_link_tip = tip_on_hand();
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int asked = 0, reached = 0, refused = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const double angle = EIGEN_PI * uniform(random);
    const Vec3 along(std::cos(angle), 0, std::sin(angle)), tip_m(0.8 * uniform(random), 0, 0.8 * uniform(random));
    const auto one = elbow(tip_m, along, 1), other = elbow(tip_m, along, -1);
    const auto within = [&](const std::optional<double>& q, double margin) { return q && *q > from + margin && *q < to - margin; };
    const bool possible = within(one, 0) || within(other, 0);
    if (possible && !within(one, 0.02) && !within(other, 0.02)) continue;  // at the very edge, either will do
    const Pose target = looking(tip_m, along);
    const auto joints = reach(kinematics, kinematics.link("hand"), target, {0, 0.5, 0}, options);
    if (!possible) {
      EXPECT_FALSE(joints) << trial;
      ++refused;
      continue;
    }
    ++asked;
    if (!joints) continue;  // shoulder and wrist stop short of half a turn: a way that needs it is no way
    ++reached;
    EXPECT_GE((*joints)[1], from);
    EXPECT_LE((*joints)[1], to);
    const Pose tip = kinematics.link_poses(kinematics.free_joints(), *joints)[3] * tip_on_hand();
    EXPECT_LT((tip.translation() - tip_m).norm(), 1e-5);
    EXPECT_GT(tip.linear().col(2).dot(along), 1 - 1e-9);
  }
  EXPECT_GT(refused, 60);
  EXPECT_GT(asked, 30);
  EXPECT_GE(reached, 0.95 * asked);
}

TEST(Reach, TakesOnlyWhatIsAccepted) {
  const Kinematics kinematics(three_joints(-2.5, 2.5));
  const Pose target = looking(Vec3(0.5, 0, 0.1), Vec3::UnitX());
  ReachOptions options;
  options.T_link_tip = tip_on_hand();
  for (const double side : {-1.0, 1.0}) {
    options.accept = [&](const std::vector<double>& joints) { return side * joints[1] > 0; };
    const auto joints = reach(kinematics, kinematics.link("hand"), target, {0, 0.5, 0}, options);
    ASSERT_TRUE(joints);
    EXPECT_GT(side * (*joints)[1], 0);
  }
  options.accept = [](const std::vector<double>&) { return false; };
  EXPECT_FALSE(reach(kinematics, kinematics.link("hand"), target, {0, 0.5, 0}, options));
  EXPECT_THROW(reach(kinematics, kinematics.link("hand"), target, {0, 0.5}), Error);
}

/// Two pushes downwards, by joints that reach them; joints err by `joint_std_rad`.
Recording pushed(const RobotModel& robot, double joint_std_rad) {
  const Kinematics kinematics(robot);
  ReachOptions options;
  options.T_link_tip = tip_on_hand();
  Recording recording;
  recording.robot = robot;
  recording.joint_names = kinematics.free_joints();
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (const double x : {0.35, 0.45}) {
    Push push;
    for (int s = 0; s < 4; ++s) {
      Step step;
      if (s > 0) {
        Load load;
        load.contact_m = Vec3(x, 0, 0.1);
        load.direction = x < 0.4 ? -Vec3::UnitZ() : Vec3(0.3, 0, -1).normalized();
        step.loads = {load};
        ToolTravel travel;
        travel.travel_m = 0.003 * s;
        step.observations = {travel};
        step.joints_rad = *reach(kinematics, kinematics.link("hand"),
                                 looking(load.contact_m + travel.travel_m * load.direction, load.direction), {-1, 2, 0.6}, options);
        for (double& q : step.joints_rad) q += joint_std_rad * normal(random);
      }
      push.steps.push_back(step);
    }
    recording.pushes.push_back(push);
  }
  return recording;
}

TEST(ArmReach, FindsTheToolFromWhereThePushesTouched) {
  const RobotModel robot = three_joints(-2.5, 2.5);
  const auto exact = find_tool(Kinematics(robot), pushed(robot, 0));
  ASSERT_TRUE(exact);
  EXPECT_EQ(exact->link, "hand");
  EXPECT_LT(exact->spread_m, 1e-5);
  EXPECT_LT((exact->T_link_tip.translation() - Vec3(hand_m, 0, 0)).norm(), 1e-5);
  EXPECT_GT(exact->T_link_tip.linear().col(2).x(), 1 - 1e-9);
  EXPECT_EQ(exact->joints.size(), 3u);
  const auto noisy = find_tool(Kinematics(robot), pushed(robot, 1e-3));
  ASSERT_TRUE(noisy);
  EXPECT_EQ(noisy->link, "hand");
  EXPECT_LT((noisy->T_link_tip.translation() - Vec3(hand_m, 0, 0)).norm(), 2e-3);
  EXPECT_GT(noisy->spread_m, 1e-4);
}

TEST(ArmReach, JointsThatExplainNothingAreNotBelieved) {
  const RobotModel robot = three_joints(-2.5, 2.5);
  EXPECT_FALSE(find_tool(Kinematics(robot), pushed(robot, 0.2)));
  Recording still = pushed(robot, 0);
  for (Push& push : still.pushes)
    for (Step& step : push.steps)
      if (!step.joints_rad.empty()) step.joints_rad = {0, 1, 0};
  EXPECT_FALSE(find_tool(Kinematics(robot), still));
  EXPECT_FALSE(find_tool(Kinematics(robot), Recording{}));
  Recording lacking = pushed(robot, 0);
  lacking.joint_names.pop_back();
  for (Push& push : lacking.pushes)
    for (Step& step : push.steps)
      if (!step.joints_rad.empty()) step.joints_rad.pop_back();
  EXPECT_THROW(find_tool(Kinematics(robot), lacking), Error);
}

TEST(ArmReach, KeepsJointsWithinTheirLimitsAndLinksInFrontOfTheTable) {
  MountedTool tool;
  tool.link = "hand";
  tool.T_link_tip = tip_on_hand();
  const Plane table{Vec3(0, 0, 0), Vec3::UnitZ()};
  const Vec3 contact_m(0.5, 0, 0.05), along = Vec3::UnitX();
  // About y, a positive angle turns downwards: with the elbow at a positive angle it stands above, else below the table.
  const ArmReach either(three_joints(-2.5, 2.5), tool, {table}), above(three_joints(0, 2.5), tool, {table}),
      below(three_joints(-2.5, 0), tool, {table}), below_without_table(three_joints(-2.5, 0), tool, {});
  EXPECT_TRUE(either.reaches(contact_m, along, 0.02, 0.02));
  EXPECT_TRUE(above.reaches(contact_m, along, 0.02, 0.02));
  EXPECT_FALSE(below.reaches(contact_m, along, 0.02, 0.02));
  EXPECT_TRUE(below_without_table.reaches(contact_m, along, 0.02, 0.02));
  // The last stretch counts: the arm is 0.8 m long.
  EXPECT_TRUE(either.reaches(Vec3(0.77, 0, 0.05), along, 0.02, 0.01));
  EXPECT_FALSE(either.reaches(Vec3(0.77, 0, 0.05), along, 0.02, 0.05));
  EXPECT_FALSE(either.reaches(Vec3(0.5, 0.1, 0.05), along, 0.02, 0.02)) << "out of its plane";
  tool.link = "finger";
  EXPECT_THROW(ArmReach(three_joints(0, 1), tool, {}), Error);
}

}  // namespace
}  // namespace palpate::sensing::reach_test
