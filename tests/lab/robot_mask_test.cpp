// label: statistics
// SPDX-License-Identifier: Apache-2.0
// The robot mask in the lab: the arm presses a cube and stands in its own camera's picture. What is masked comes from noisy
// encoders and a z-buffer, what is true from a ray caster and the true joints.
#include "palpate/sensing/robot_mask.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "palpate/core/error.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/arm.hpp"
#include "palpate/lab/depth_sensor.hpp"
#include "palpate/lab/random.hpp"
#include "palpate/lab/scene.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/reach.hpp"

namespace palpate::lab::robot_mask_test {
namespace {

TriMesh block(const Vec3& min, const Vec3& max) {
  RobotShape shape;
  shape.kind = RobotShape::Kind::box;
  shape.size_m = max - min;
  TriMesh mesh = sensing::shape_mesh(shape);
  mesh.vertices_m.rowwise() += (0.5 * (min + max)).transpose();
  return mesh;
}

Camera vga() {
  Camera camera;
  camera.width_px = 640;
  camera.height_px = 480;
  camera.fx_px = camera.fy_px = 606;
  camera.cx_px = 322.4;
  camera.cy_px = 238.1;
  return camera;
}

struct Share {
  double robot_found, object_lost, near_contact_lost;
};

// The fixed camera sees arm, stick and cube; 0.02 degrees of error a joint.
Share measure(std::uint64_t seed) {
  constexpr double tool_radius_m = 0.012;
  ArmOptions arm_options;
  arm_options.pad_radius_m = tool_radius_m;
  const sensing::RobotMask mask(arm(arm_options));
  const sensing::Kinematics& kinematics = mask.kinematics();
  const std::vector<std::string>& names = kinematics.free_joints();

  Random random(seed);
  const Vec3 contact(0.62 + 0.03 * random.normal(), 0.03 * random.normal(), 0.15);
  Pose T_base_tip = Pose::Identity();
  T_base_tip.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  T_base_tip.translation() = contact;
  const auto joints = sensing::reach(kinematics, kinematics.link("tip"), T_base_tip, {0, 0.6, 1.2, 0, 1.3, 0, 0.05});
  if (!joints) throw Error("the arm does not reach the cube", "measure");
  std::vector<double> read = *joints;
  for (double& q : read) q += 0.02 * M_PI / 180 * random.normal();

  const auto poses = kinematics.link_poses(names, *joints);
  std::vector<std::unique_ptr<geometry::TriangleTree>> trees;
  trees.push_back(std::make_unique<geometry::TriangleTree>(block({0.545, -0.075, 0}, {0.695, 0.075, 0.15})));
  for (std::size_t i = 0; i < kinematics.robot().links.size(); ++i)
    for (const RobotShape& shape : kinematics.robot().links[i].visual) {
      TriMesh posed = sensing::shape_mesh(shape);
      for (Eigen::Index v = 0; v < posed.vertices_m.rows(); ++v)
        posed.vertices_m.row(v) = poses[i] * (shape.T_link_shape * Vec3(posed.vertices_m.row(v)));
      trees.push_back(std::make_unique<geometry::TriangleTree>(std::move(posed)));
    }
  Scene scene;
  for (const auto& tree : trees) scene.bodies.push_back(tree.get());
  scene.planes.push_back(Plane{});

  DepthFrame frame;
  frame.camera = vga();
  frame.T_base_camera = look_at(Vec3(0.35, -0.45, 0.55), Vec3(0.62, 0, 0.12));
  frame.noise.model = "realsense_d435";
  const PerfectView view = cast_view(scene, frame.camera, frame.T_base_camera);
  frame.depth_m = sense_depth(view, frame.camera, {}, random);
  const MaskImage masked = mask.mask(frame, names, read);

  int robot = 0, found = 0, object = 0, lost = 0, near = 0, near_lost = 0;
  for (int row = 0; row < 480; ++row)
    for (int column = 0; column < 640; ++column) {
      if (!(frame.depth_m(row, column) > 0)) continue;
      const int label = view.label(row, column);
      if (label == 1) {
        ++object;
        lost += masked(row, column);
        const Vec3 point =
            frame.T_base_camera * Vec3(view.depth_m(row, column) * *sensing::unproject(frame.camera, Vec2(column, row)));
        if ((point - contact).norm() < 3 * tool_radius_m) {
          ++near;
          near_lost += masked(row, column);
        }
      } else if (label > 1 && label <= int(scene.bodies.size())) {
        ++robot;
        found += masked(row, column);
      }
    }
  EXPECT_GT(robot, 2000);
  EXPECT_GT(object, 10000);
  EXPECT_GT(near, 300);
  return {double(found) / robot, double(lost) / object, double(near_lost) / near};
}

TEST(RobotMaskInTheLab, FindsTheRobotAndSparesTheObject) {
  double worst_found = 1, worst_lost = 0, worst_near = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Share share = measure(seed);
    worst_found = std::min(worst_found, share.robot_found);
    worst_lost = std::max(worst_lost, share.object_lost);
    worst_near = std::max(worst_near, share.near_contact_lost);
  }
  RecordProperty("worst_robot_found", std::to_string(worst_found));
  RecordProperty("worst_object_lost", std::to_string(worst_lost));
  RecordProperty("worst_near_contact_lost", std::to_string(worst_near));
  EXPECT_GE(worst_found, 0.99);
  EXPECT_LE(worst_lost, 0.02);
  EXPECT_LE(worst_near, 0.10);
}

TEST(RobotMaskInTheLab, ArmReachesWhereItIsSent) {
  const sensing::Kinematics kinematics(arm());
  Random random(4);
  int reached = 0;
  for (int trial = 0; trial < 20; ++trial) {
    Pose target = Pose::Identity();
    target.linear() =
        Eigen::AngleAxisd(M_PI - 0.3 * random.uniform(), Vec3(random.normal(), 1, 0).normalized()).toRotationMatrix();
    target.translation() = Vec3(random.uniform(0.45, 0.7), random.uniform(-0.3, 0.3), random.uniform(0.05, 0.3));
    const auto joints = sensing::reach(kinematics, kinematics.link("tip"), target, {0, 0.6, 1.2, 0, 1.3, 0, 0.05});
    if (!joints) continue;
    ++reached;
    const Pose pose = kinematics.link_poses(kinematics.free_joints(), *joints)[std::size_t(kinematics.link("tip"))];
    EXPECT_LT((pose.translation() - target.translation()).norm(), 1e-5);
    EXPECT_GT(pose.linear().col(2).dot(target.linear().col(2)), 1 - 1e-9);
  }
  EXPECT_GE(reached, 19);
  Pose far = Pose::Identity();
  far.translation() = Vec3(5, 0, 0);
  EXPECT_FALSE(sensing::reach(kinematics, kinematics.link("tip"), far, std::vector<double>(7, 0.1)));
}

}  // namespace
}  // namespace palpate::lab::robot_mask_test
