// label: oracle
// SPDX-License-Identifier: Apache-2.0
// Forward kinematics of random trees against the Orocos Kinematics and Dynamics Library.
#include <gtest/gtest.h>

#include "palpate/sensing/kinematics.hpp"

#ifdef PALPATE_WITH_KDL
#include <kdl/treefksolverpos_recursive.hpp>
#endif
#include <random>

namespace palpate::sensing::kinematics_kdl_test {
namespace {

#ifdef PALPATE_WITH_KDL

KDL::Frame to_kdl(const Pose& pose) {
  KDL::Frame frame;
  for (int i = 0; i < 3; ++i) {
    frame.p(i) = pose.translation()(i);
    for (int j = 0; j < 3; ++j) frame.M(i, j) = pose.linear()(i, j);
  }
  return frame;
}

TEST(KinematicsAgainstKdl, RandomTreesAgree) {
  std::mt19937 generator(42);
  std::uniform_real_distribution<double> any(-1, 1);
  const auto vector = [&] { return Vec3(any(generator), any(generator), any(generator)); };
  for (int trial = 0; trial < 50; ++trial) {
    RobotModel robot;
    robot.name = "tree";
    robot.links.push_back({"link_0", {}, {}});
    KDL::Tree tree("link_0");
    std::vector<std::string> names;
    std::vector<double> positions;
    for (int i = 1; i < 14; ++i) {
      RobotJoint joint;
      joint.name = "joint_" + std::to_string(i);
      joint.parent = "link_" + std::to_string(std::uniform_int_distribution<int>(0, i - 1)(generator));
      joint.child = "link_" + std::to_string(i);
      joint.axis = vector();
      joint.T_parent_joint = Eigen::Translation3d(vector()) * Eigen::AngleAxisd(3 * any(generator), vector().normalized());
      const int kind = std::uniform_int_distribution<int>(0, 3)(generator);
      joint.kind = RobotJoint::Kind(kind);
      robot.links.push_back({joint.child, {}, {}});
      robot.joints.push_back(joint);
      // KDL moves first and places its frame after the joint: the fixed part goes into a segment of its own.
      tree.addSegment(KDL::Segment(joint.child + "_place", KDL::Joint(KDL::Joint::None), to_kdl(joint.T_parent_joint)),
                      joint.parent);
      const KDL::Vector axis(joint.axis.x(), joint.axis.y(), joint.axis.z());
      KDL::Joint moving(KDL::Joint::None);
      if (joint.kind == RobotJoint::Kind::prismatic)
        moving = KDL::Joint(joint.name, KDL::Vector::Zero(), axis, KDL::Joint::TransAxis);
      else if (joint.kind != RobotJoint::Kind::fixed)
        moving = KDL::Joint(joint.name, KDL::Vector::Zero(), axis, KDL::Joint::RotAxis);
      tree.addSegment(KDL::Segment(joint.child, moving), joint.child + "_place");
      if (joint.kind != RobotJoint::Kind::fixed) {
        names.push_back(joint.name);
        positions.push_back(3 * any(generator));
      }
    }
    if (names.empty()) continue;
    // The solver copies the tree, and a copy numbers its joints anew, depth first: ask a copy for its numbers.
    const KDL::Tree copy(tree);
    KDL::JntArray q(copy.getNrOfJoints());
    for (std::size_t k = 0; k < names.size(); ++k)
      q(copy.getSegment("link_" + names[k].substr(6))->second.q_nr) = positions[k];
    KDL::TreeFkSolverPos_recursive solver(copy);
    const Kinematics ours(robot);
    const auto poses = ours.link_poses(names, positions);
    for (const RobotLink& link : robot.links) {
      KDL::Frame theirs;
      ASSERT_GE(solver.JntToCart(q, theirs, link.name), 0);
      const Pose& pose = poses[std::size_t(ours.link(link.name))];
      for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(pose.translation()(i), theirs.p(i), 1e-9) << link.name;
        for (int j = 0; j < 3; ++j) EXPECT_NEAR(pose.linear()(i, j), theirs.M(i, j), 1e-9) << link.name;
      }
    }
  }
}

#else
TEST(KinematicsAgainstKdl, RandomTreesAgree) { GTEST_SKIP() << "built without liborocos-kdl-dev"; }
#endif

}  // namespace
}  // namespace palpate::sensing::kinematics_kdl_test
