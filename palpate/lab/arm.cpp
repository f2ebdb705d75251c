// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/arm.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"

namespace palpate::lab {
namespace {

Pose at(double x, double y, double z) { return Pose(Eigen::Translation3d(x, y, z)); }

// A module's housing: a barrel around z with a slight waist, as turned parts have.
RobotShape barrel(double radius_m, double length_m, double from_m, const ArmOptions& o) {
  RobotShape shape;
  shape.kind = RobotShape::Kind::mesh;
  TriMesh& mesh = shape.mesh;
  const Eigen::Index rings = o.rings, sides = o.round_sides;
  mesh.vertices_m.resize(rings * sides, 3);
  for (Eigen::Index r = 0; r < rings; ++r)
    for (Eigen::Index s = 0; s < sides; ++s) {
      const double share = double(r) / double(rings - 1), angle = 2 * M_PI * double(s) / double(sides);
      const double closing = r == 0 || r == rings - 1 ? 0.0 : 1.0;  // end caps
      const double radius = closing * radius_m * (1 - 0.1 * std::sin(M_PI * share));
      mesh.vertices_m.row(r * sides + s) << radius * std::cos(angle), radius * std::sin(angle),
          from_m + length_m * std::clamp((double(r) - 1) / double(rings - 3), 0.0, 1.0);
    }
  mesh.triangles.resize(2 * (rings - 1) * sides, 3);
  Eigen::Index t = 0;
  for (Eigen::Index r = 0; r + 1 < rings; ++r)
    for (Eigen::Index s = 0; s < sides; ++s) {
      const auto a = Index(r * sides + s), b = Index(r * sides + (s + 1) % sides);
      mesh.triangles.row(t++) << a, b, b + Index(sides);
      mesh.triangles.row(t++) << a, b + Index(sides), a + Index(sides);
    }
  return shape;
}

RobotShape rod(double radius_m, double length_m, double from_m) {
  RobotShape shape;
  shape.kind = RobotShape::Kind::cylinder;
  shape.size_m = {radius_m, length_m, 0};
  shape.T_link_shape = at(0, 0, from_m + 0.5 * length_m);
  return shape;
}

}  // namespace

RobotModel arm(const ArmOptions& o) {
  if (o.round_sides < 3 || o.rings < 5) throw Error("needs at least 3 sides and 5 rings", "ArmOptions.round_sides, rings");
  if (!(o.stick_radius_m > 0) || !(o.stick_length_m > 0))
    throw Error("must be positive", "ArmOptions.stick_radius_m, stick_length_m");
  if (!(o.pad_radius_m >= 0)) throw Error("must not be negative", "ArmOptions.pad_radius_m");
  RobotModel robot;
  robot.name = "lab_arm";
  const auto link = [&](const std::string& name, std::vector<RobotShape> shapes) {
    robot.links.push_back({name, shapes, shapes});
  };
  const auto joint = [&](const std::string& name, const std::string& parent, const std::string& child, const Pose& place,
                         const Vec3& axis, double limit) {
    RobotJoint j;
    j.kind = limit > 0 ? RobotJoint::Kind::revolute : RobotJoint::Kind::fixed;
    j.name = name;
    j.parent = parent;
    j.child = child;
    j.T_parent_joint = place;
    j.axis = axis;
    j.lower = -limit;
    j.upper = limit;
    j.velocity = 0.5;
    robot.joints.push_back(j);
  };
  link("base", {});
  link("arm_base", {barrel(0.09, 0.15, 0.0, o)});
  link("module_1", {barrel(0.065, 0.13, 0.0, o)});
  link("module_2", {barrel(0.06, 0.34, -0.05, o)});
  link("module_3", {barrel(0.055, 0.18, -0.05, o)});
  link("module_4", {barrel(0.05, 0.15, 0.0, o)});
  link("module_5", {barrel(0.045, 0.12, -0.04, o)});
  link("hand_pan", {barrel(0.04, 0.06, 0.0, o)});
  link("hand_tilt", {barrel(0.035, 0.09, -0.03, o)});
  std::vector<RobotShape> tool{rod(o.stick_radius_m, o.stick_length_m, 0.0)};
  if (o.pad_radius_m > 0) tool.push_back(rod(o.pad_radius_m, 0.008, o.stick_length_m - 0.008));
  link("stick", tool);
  link("tip", {});
  joint("arm_mount", "base", "arm_base", o.T_base_arm, Vec3::UnitZ(), 0);
  joint("joint_1", "arm_base", "module_1", at(0, 0, 0.15), Vec3::UnitZ(), 2.9);
  joint("joint_2", "module_1", "module_2", at(0, 0, 0.14), Vec3::UnitY(), 2.1);
  joint("joint_3", "module_2", "module_3", at(0, 0, 0.33), Vec3::UnitY(), 2.4);
  joint("joint_4", "module_3", "module_4", at(0, 0, 0.13), Vec3::UnitZ(), 2.9);
  joint("joint_5", "module_4", "module_5", at(0, 0, 0.19), Vec3::UnitY(), 2.1);
  joint("pan", "module_5", "hand_pan", at(0, 0, 0.09), Vec3::UnitZ(), 2.9);
  joint("tilt", "hand_pan", "hand_tilt", at(0, 0, 0.09), Vec3::UnitY(), 2.1);
  joint("stick_mount", "hand_tilt", "stick", at(0, 0, 0.06), Vec3::UnitZ(), 0);
  joint("tip_mount", "stick", "tip", at(0, 0, o.stick_length_m), Vec3::UnitZ(), 0);
  if (!o.camera_on_hand) return robot;
  link("camera", {});
  // Beside the hand, tilted towards the tip so that the contact is in view.
  Pose eye = at(0.10, 0, 0.02);
  eye.rotate(Eigen::AngleAxisd(-0.25, Vec3::UnitY()));
  joint("camera_mount", "hand_tilt", "camera", eye, Vec3::UnitZ(), 0);
  return robot;
}

}  // namespace palpate::lab
