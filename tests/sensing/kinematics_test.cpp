// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/kinematics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "palpate/core/error.hpp"

namespace palpate::sensing::kinematics_test {
namespace {

RobotJoint joint(const std::string& name, const std::string& parent, const std::string& child, RobotJoint::Kind kind,
                 const Vec3& axis, const Vec3& offset) {
  RobotJoint j;
  j.name = name;
  j.parent = parent;
  j.child = child;
  j.kind = kind;
  j.axis = axis;
  j.T_parent_joint = Eigen::Translation3d(offset);
  return j;
}

// Two bars of 1 m and 0.5 m in the x-y plane, a slide along the second, a gripper of two fingers that mimic each other.
// Links and joints are listed out of order on purpose.
RobotModel planar() {
  RobotModel robot;
  robot.name = "planar";
  for (const char* name : {"finger_b", "slide", "lower", "world", "upper", "finger_a"})
    robot.links.push_back({name, {}, {}});
  using Kind = RobotJoint::Kind;
  robot.joints.push_back(joint("open_b", "slide", "finger_b", Kind::prismatic, Vec3::UnitY(), {0, 0, 0}));
  robot.joints.back().mimic = "open_a";
  robot.joints.back().mimic_multiplier = -1;
  robot.joints.back().mimic_offset = 0.01;
  robot.joints.push_back(joint("extend", "lower", "slide", Kind::prismatic, Vec3(2, 0, 0), {0.5, 0, 0}));
  robot.joints.push_back(joint("elbow", "upper", "lower", Kind::continuous, Vec3::UnitZ(), {1, 0, 0}));
  robot.joints.push_back(joint("shoulder", "world", "upper", Kind::revolute, Vec3::UnitZ(), {0, 0, 0.2}));
  robot.joints.push_back(joint("open_a", "slide", "finger_a", Kind::prismatic, Vec3::UnitY(), {0, 0, 0}));
  return robot;
}

TEST(Kinematics, PlanarArmClosedForm) {
  const Kinematics arm(planar());
  EXPECT_EQ(arm.robot().links[std::size_t(arm.root_link())].name, "world");
  EXPECT_THAT(arm.free_joints(), testing::ElementsAre("extend", "elbow", "shoulder", "open_a"));
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> angle(-3, 3);
  for (int i = 0; i < 20; ++i) {
    const double a = angle(generator), b = angle(generator), d = 0.1 * angle(generator), open = 0.01 * angle(generator);
    const auto poses = arm.link_poses({"shoulder", "elbow", "extend", "open_a"}, {a, b, d, open});
    const Vec3 slide = poses[std::size_t(arm.link("slide"))].translation();
    const double reach = 0.5 + d;
    EXPECT_NEAR(slide.x(), std::cos(a) + reach * std::cos(a + b), 1e-12);
    EXPECT_NEAR(slide.y(), std::sin(a) + reach * std::sin(a + b), 1e-12);
    EXPECT_NEAR(slide.z(), 0.2, 1e-12);
    const Vec3 side(-std::sin(a + b), std::cos(a + b), 0);
    const Vec3 finger_a = poses[std::size_t(arm.link("finger_a"))].translation();
    const Vec3 finger_b = poses[std::size_t(arm.link("finger_b"))].translation();
    EXPECT_NEAR((finger_a - slide - open * side).norm(), 0, 1e-12);
    EXPECT_NEAR((finger_b - slide - (0.01 - open) * side).norm(), 0, 1e-12);
    EXPECT_TRUE(poses[std::size_t(arm.link("world"))].isApprox(Pose::Identity()));
  }
}

TEST(Kinematics, PositionUncertaintyAgreesWithMonteCarlo) {
  const Kinematics arm(planar());
  const std::vector<std::string> names{"shoulder", "elbow", "extend", "open_a"};
  const std::vector<double> at{0.4, -1.1, 0.1, 0.0};
  const Vec3 point(0.2, 0.1, 0);
  const Index slide = arm.link("slide");
  const auto poses = arm.link_poses(names, at);
  const double predicted = arm.position_std_m(poses, slide, point, 1e-3);
  std::mt19937 generator(2);
  std::normal_distribution<double> error(0, 1e-3);
  double variance = 0;
  Mat3 moved_covariance = Mat3::Zero();
  constexpr int trials = 20000;
  for (int i = 0; i < trials; ++i) {
    const auto moved = arm.link_poses(names, {at[0] + error(generator), at[1] + error(generator), at[2], at[3]});
    const Vec3 off = moved[std::size_t(slide)] * point - poses[std::size_t(slide)] * point;
    variance += off.squaredNorm() / trials;
    moved_covariance += off * off.transpose() / trials;
  }
  EXPECT_NEAR(std::sqrt(variance) / predicted, 1, 0.03);
  EXPECT_LT((moved_covariance - arm.position_covariance_m2(poses, slide, point, 1e-3)).norm(), 0.05 * variance);
}

TEST(Kinematics, EveryBrokenTreeIsRefusedByName) {
  const auto complaint = [](auto change) -> std::string {
    RobotModel robot = planar();
    change(robot);
    try {
      Kinematics arm(robot);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  using R = RobotModel;
  EXPECT_EQ(complaint([](R&) {}), "accepted");
  EXPECT_THAT(complaint([](R& r) { r.links.clear(); }), testing::HasSubstr("no link"));
  EXPECT_THAT(complaint([](R& r) { r.links[1].name = "lower"; }), testing::HasSubstr("two links named 'lower'"));
  EXPECT_THAT(complaint([](R& r) { r.joints[1].name = "elbow"; }), testing::HasSubstr("two joints named 'elbow'"));
  EXPECT_THAT(complaint([](R& r) { r.joints[1].parent = "leg"; }), testing::HasSubstr("'leg'"));
  EXPECT_THAT(complaint([](R& r) { r.joints[0].child = "lower"; }), testing::HasSubstr("second parent"));
  EXPECT_THAT(complaint([](R& r) { r.joints.erase(r.joints.begin()); }), testing::HasSubstr("two roots"));
  EXPECT_THAT(complaint([](R& r) { r.joints[3].parent = "slide"; }), testing::HasSubstr("loop"));
  EXPECT_THAT(complaint([](R& r) {
                r.links.push_back({"base", {}, {}});
                r.joints.push_back(joint("ring", "lower", "world", RobotJoint::Kind::fixed, Vec3::UnitX(), Vec3::Zero()));
              }),
              testing::HasSubstr("loop"));
  EXPECT_THAT(complaint([](R& r) { r.joints[2].axis.setZero(); }), testing::HasSubstr("axis"));
  EXPECT_THAT(complaint([](R& r) { r.joints[0].mimic = "nobody"; }), testing::HasSubstr("'nobody'"));
  EXPECT_THAT(complaint([](R& r) { r.joints[0].mimic = "open_b"; }), testing::HasSubstr("no value of its own"));

  const Kinematics arm(planar());
  EXPECT_THROW(arm.link("leg"), Error);
  EXPECT_THROW(arm.link_poses({"shoulder", "elbow", "extend"}, {0, 0, 0}), Error);            // open_a is missing
  EXPECT_THROW(arm.link_poses({"shoulder", "elbow", "extend", "open_a"}, {0, 0, 0}), Error);  // a count too few
  EXPECT_THROW(arm.link_poses({"shoulder", "elbow", "extend", "open_a", "knee"}, {0, 0, 0, 0, 0}), Error);
  EXPECT_THROW(arm.link_poses({"shoulder", "elbow", "extend", "open_a"}, {0, NAN, 0, 0}), Error);
}

TEST(Kinematics, PosesOfJointsOneAfterAnotherAreThoseOfTheLinks) {
  const Kinematics arm(planar());
  const std::vector<std::string> names{"shoulder", "elbow", "extend", "open_a"};
  const auto links = arm.link_poses(names, {0.3, -0.4, 0.05, 0.01});
  const auto joints = arm.joint_poses(names, {0.3, -0.4, 0.05, 0.01});
  ASSERT_EQ(joints.size(), arm.robot().joints.size());
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const RobotJoint& joint = arm.robot().joints[j];
    ASSERT_TRUE(joints[j]) << joint.name;
    EXPECT_TRUE((links[std::size_t(arm.link(joint.parent))] * *joints[j]).isApprox(links[std::size_t(arm.link(joint.child))], 1e-12)) << joint.name;
  }
  // Of a joint alone nothing is hidden but its own.
  const auto some = arm.joint_poses({"extend"}, {0.05});
  for (std::size_t j = 0; j < some.size(); ++j) {
    const RobotJoint& joint = arm.robot().joints[j];
    EXPECT_EQ(bool(some[j]), joint.kind == RobotJoint::Kind::fixed || joint.name == "extend") << joint.name;
  }
}

/// A gripper that nobody tells anything of, an elbow that is not known: what hangs on it is not, the rest is.
TEST(Kinematics, AJointWithoutAValueHidesWhatHangsOnIt) {
  const Kinematics arm(planar());
  const auto whole = arm.link_poses({"shoulder", "elbow", "extend", "open_a"}, {0.3, -0.4, 0.05, 0.01});
  const auto closed = arm.known_link_poses({"shoulder", "elbow", "extend"}, {0.3, -0.4, 0.05});
  for (const char* name : {"world", "upper", "lower", "slide"}) {
    const auto i = std::size_t(arm.link(name));
    ASSERT_TRUE(closed[i]) << name;
    EXPECT_EQ(closed[i]->matrix(), whole[i].matrix()) << name;
  }
  EXPECT_FALSE(closed[std::size_t(arm.link("finger_a"))]);
  EXPECT_FALSE(closed[std::size_t(arm.link("finger_b"))]) << "it mimics the other";
  const auto stiff = arm.known_link_poses({"shoulder", "elbow", "open_a"}, {0.3, NAN, 0.01});
  EXPECT_TRUE(stiff[std::size_t(arm.link("upper"))]);
  for (const char* name : {"lower", "slide", "finger_a"}) EXPECT_FALSE(stiff[std::size_t(arm.link(name))]) << name;
  EXPECT_EQ(arm.missing_joint(arm.link("finger_b"), {"shoulder", "elbow", "extend"}), "open_a");
  EXPECT_EQ(arm.missing_joint(arm.link("finger_b"), {"shoulder"}), "elbow") << "the first from the root";
  EXPECT_EQ(arm.missing_joint(arm.link("slide"), {"extend", "shoulder", "elbow"}), std::nullopt);
  EXPECT_THROW(arm.known_link_poses({"knee"}, {0}), Error);
}

}  // namespace
}  // namespace palpate::sensing::kinematics_test
