// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/cloud_mask.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "palpate/core/error.hpp"

namespace palpate::sensing::cloud_mask_test {
namespace {

enum class Part { table, object, robot, wall };

/// A cube of 0.1 m on a table, a ball of the robot beside it, a wall of the room 2 m behind; seen from above at an angle, with
/// noise along the rays.
struct RoomCloud {
  PointCloud cloud;
  std::vector<Part> part;
};

constexpr double sigma_m = 1e-3;
const Vec3 eye_m(-0.6, 0, 0.6);
const Vec3 ball_m(0.02, 0.1, 0.1);
constexpr double ball_radius_m = 0.04;

RoomCloud room_cloud(int points_a_part) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> share(0, 1);
  std::normal_distribution<double> normal;
  RoomCloud room;
  std::vector<Vec3> points;
  const auto add = [&](Part part, const Vec3& at) {
    points.push_back(at + sigma_m * normal(random) * (at - eye_m).normalized());
    room.part.push_back(part);
  };
  for (int i = 0; i < points_a_part; ++i) {
    add(Part::table, {-0.25 + 0.2 * share(random), share(random) - 0.5, 0});  // before the cube, and to its sides
    add(Part::object, {-0.05, 0.1 * share(random) - 0.05, 0.1 * share(random)});
    add(Part::object, {0.1 * share(random) - 0.05, 0.1 * share(random) - 0.05, 0.1});
    const Vec3 out = Vec3(normal(random), normal(random), normal(random)).normalized();
    add(Part::robot, ball_m + ball_radius_m * out);
    add(Part::wall, {2, share(random) - 0.5, share(random)});
  }
  const auto count = static_cast<Index>(points.size());
  room.cloud.points_m.resize(count, 3);
  room.cloud.normals = Points::Zero(count, 3);
  room.cloud.sigma_m = VectorX::Constant(count, sigma_m);
  for (Index i = 0; i < count; ++i) {
    room.cloud.points_m.row(i) = points[static_cast<std::size_t>(i)];
    room.cloud.normals(i, 0) = i;  // says afterwards which one it was
  }
  return room;
}

RobotModel ball_robot() {
  RobotShape shape;
  shape.kind = RobotShape::Kind::sphere;
  shape.size_m = {ball_radius_m, 0, 0};
  RobotModel robot;
  robot.name = "ball";
  robot.links = {{"root", {}, {}}, {"ball", {shape}, {}}};
  RobotJoint lift;
  lift.name = "lift";
  lift.kind = RobotJoint::Kind::prismatic;
  lift.parent = "root";
  lift.child = "ball";
  lift.axis = Vec3::UnitZ();
  lift.T_parent_joint = Eigen::Translation3d(ball_m.x(), ball_m.y(), 0);
  lift.lower = -1;
  lift.upper = 1;
  robot.joints = {lift};
  return robot;
}

const Vec3 low_m(-0.15, -0.15, -0.1), high_m(0.15, 0.15, 0.2);
const std::vector<Plane> table{Plane{}};

struct Counts {
  int of[4] = {};
};

Counts counts(const RoomCloud& room, const PointCloud& left) {
  Counts out;
  for (Index i = 0; i < left.points_m.rows(); ++i) ++out.of[static_cast<int>(room.part[static_cast<std::size_t>(left.normals(i, 0))])];
  return out;
}

TEST(PointsOfObject, AreNearItAndAboveTheTable) {
  const RoomCloud room = room_cloud(1000);
  const PointCloud left = points_of_object(room.cloud, table, low_m, high_m);
  const Counts found = counts(room, left);
  EXPECT_EQ(found.of[static_cast<int>(Part::table)], 0);
  EXPECT_EQ(found.of[static_cast<int>(Part::wall)], 0);
  EXPECT_GT(found.of[static_cast<int>(Part::object)], 1900) << "of the flank 6 mm go with the table";
  ASSERT_EQ(left.sigma_m.size(), left.points_m.rows());
  for (Index i = 0; i < left.points_m.rows(); ++i)
    EXPECT_EQ(left.points_m.row(i), room.cloud.points_m.row(static_cast<Index>(left.normals(i, 0))));
}

TEST(RobotInClouds, IsTakenOutWhereItIs) {
  const RoomCloud room = room_cloud(1000);
  const RobotMask robot(ball_robot());
  const RobotInClouds in_clouds(robot);
  const auto robot_points = [&](double lift_m, const Vec3& root_m) {
    Pose T_base_root = Pose::Identity();
    T_base_root.translation() = root_m;
    return counts(room, in_clouds.without_robot(room.cloud, {"lift"}, {lift_m}, T_base_root)).of[static_cast<int>(Part::robot)];
  };
  EXPECT_EQ(robot_points(ball_m.z(), Vec3::Zero()), 0);
  EXPECT_EQ(robot_points(0, Vec3(0, 0, ball_m.z())), 0);
  EXPECT_EQ(robot_points(0.8, Vec3::Zero()), 1000);
  EXPECT_EQ(counts(room, in_clouds.without_robot(room.cloud, {}, {})).of[static_cast<int>(Part::robot)], 1000)
      << "nobody knows where it is";
  // Of the cube a strip goes that comes within 1 cm of the ball.
  EXPECT_GT(counts(room, in_clouds.without_robot(room.cloud, {"lift"}, {ball_m.z()})).of[static_cast<int>(Part::object)], 1900);
}

/// A plate whose top is 7 mm above the table, seen straight down: mean height of what is left of it. The table's margin is 6 mm.
double mean_height_m(int neighbours) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> share(0, 1);
  std::normal_distribution<double> normal;
  PointCloud cloud;
  cloud.sigma_m = VectorX::Constant(1, sigma_m);
  cloud.points_m.resize(10000, 3);
  for (Index i = 0; i < cloud.points_m.rows(); ++i)
    cloud.points_m.row(i) << 0.1 * share(random) - 0.05, 0.1 * share(random) - 0.05, 0.007 + sigma_m * normal(random);
  CloudMaskOptions options;
  options.neighbours = neighbours;
  options.most_points = 1e9;
  return points_of_object(cloud, table, low_m, high_m, options).points_m.col(2).mean();
}

TEST(PointsOfObject, AreNotChosenByTheirOwnNoise) {
  EXPECT_GT(mean_height_m(0), 0.007 + 0.2 * sigma_m);
  EXPECT_NEAR(mean_height_m(24), 0.007, 0.05 * sigma_m);
}

TEST(PointsOfObject, AreThinnedWhereTheyAreDense) {
  const RoomCloud room = room_cloud(20000);
  const PointCloud left = points_of_object(room.cloud, table, low_m, high_m);
  EXPECT_LE(left.points_m.rows(), 6000);
  EXPECT_GT(left.points_m.rows(), 3000);
  EXPECT_EQ(counts(room, left).of[static_cast<int>(Part::table)], 0);
}

TEST(PointsOfObject, AreAllOfACloudOfTheObject) {
  const RoomCloud room = room_cloud(1000);
  EXPECT_EQ(points_of_object(room.cloud, {}, Vec3::Constant(-10), Vec3::Constant(10)).points_m, room.cloud.points_m);
}

TEST(PointsOfObject, MayBeNone) {
  EXPECT_EQ(points_of_object(room_cloud(10).cloud, table, Vec3::Constant(5), Vec3::Constant(6)).points_m.rows(), 0);
}

TEST(PointsOfObject, RefuseWhatCannotBe) {
  RoomCloud room = room_cloud(10);
  const auto refused = [&](const CloudMaskOptions& options) {
    EXPECT_THROW(points_of_object(room.cloud, table, low_m, high_m, options), Error);
  };
  CloudMaskOptions options;
  options.neighbours = -1;
  refused(options);
  options = {};
  options.most_points = 0;
  refused(options);
  options = {};
  options.planes.margin_m = -1;
  refused(options);
  const RobotMask robot(ball_robot());
  EXPECT_THROW(RobotInClouds(robot, -1), Error);
  room.cloud.sigma_m = VectorX::Constant(3, 1e-3);
  refused({});
  EXPECT_THROW(RobotInClouds(robot).without_robot(room.cloud, {}, {}), Error);
}

}  // namespace
}  // namespace palpate::sensing::cloud_mask_test
