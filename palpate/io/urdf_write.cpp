// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>

#include "palpate/io/mesh_file.hpp"
#include "palpate/io/urdf.hpp"
#include "palpate/io/xml.hpp"

namespace palpate::io {
namespace {

std::string numbers(const Vec3& value) { return fmt::format("{} {} {}", value.x(), value.y(), value.z()); }

std::string origin_text(const Pose& pose) {
  const Mat3 r = pose.linear();
  // R = Rz(yaw) Ry(pitch) Rx(roll)
  const double pitch = std::atan2(-r(2, 0), std::hypot(r(0, 0), r(1, 0)));
  const bool upright = std::hypot(r(0, 0), r(1, 0)) < 1e-12;  // roll and yaw turn about one axis: roll takes it all
  const double roll = upright ? std::atan2(-r(1, 2), r(1, 1)) : std::atan2(r(2, 1), r(2, 2));
  const double yaw = upright ? 0.0 : std::atan2(r(1, 0), r(0, 0));
  return fmt::format("<origin xyz=\"{}\" rpy=\"{} {} {}\"/>", numbers(pose.translation()), roll, pitch, yaw);
}

const char* name_of(RobotJoint::Kind kind) {
  switch (kind) {
    case RobotJoint::Kind::revolute:
      return "revolute";
    case RobotJoint::Kind::continuous:
      return "continuous";
    case RobotJoint::Kind::prismatic:
      return "prismatic";
    case RobotJoint::Kind::fixed:
      break;
  }
  return "fixed";
}

}  // namespace

std::map<std::string, std::string> urdf_files(const RobotModel& robot, const std::string& stem) {
  std::map<std::string, std::string> files;
  std::string text = "<?xml version=\"1.0\"?>\n<robot name=\"" + xml_escaped(robot.name) + "\">\n";
  int meshes = 0;
  const auto shape_text = [&](const RobotShape& shape, const char* element) {
    std::string geometry;
    switch (shape.kind) {
      case RobotShape::Kind::mesh: {
        MeshData mesh;
        mesh.points_m = shape.mesh.vertices_m;
        mesh.triangles = shape.mesh.triangles;
        const std::string file = fmt::format("{}_meshes/{}.ply", stem, meshes++);
        files[file] = mesh_format_named("ply").write(mesh);
        geometry = fmt::format("<mesh filename=\"{}\"/>", file);
        break;
      }
      case RobotShape::Kind::box:
        geometry = fmt::format("<box size=\"{}\"/>", numbers(shape.size_m));
        break;
      case RobotShape::Kind::cylinder:
        geometry = fmt::format("<cylinder radius=\"{}\" length=\"{}\"/>", shape.size_m.x(), shape.size_m.y());
        break;
      case RobotShape::Kind::sphere:
        geometry = fmt::format("<sphere radius=\"{}\"/>", shape.size_m.x());
        break;
    }
    text += fmt::format("    <{0}>{1}<geometry>{2}</geometry></{0}>\n", element, origin_text(shape.T_link_shape), geometry);
  };
  for (const RobotLink& link : robot.links) {
    text += "  <link name=\"" + xml_escaped(link.name) + "\">\n";
    for (const RobotShape& shape : link.visual) shape_text(shape, "visual");
    for (const RobotShape& shape : link.collision) shape_text(shape, "collision");
    text += "  </link>\n";
  }
  for (const RobotJoint& joint : robot.joints) {
    text += fmt::format(
        "  <joint name=\"{}\" type=\"{}\">\n    {}\n    <parent link=\"{}\"/><child link=\"{}\"/><axis xyz=\"{}\"/>\n",
        xml_escaped(joint.name), name_of(joint.kind), origin_text(joint.T_parent_joint), xml_escaped(joint.parent),
        xml_escaped(joint.child), numbers(joint.axis));
    text += fmt::format("    <limit lower=\"{}\" upper=\"{}\" velocity=\"{}\" effort=\"0\"/>\n", joint.lower, joint.upper,
                        joint.velocity);
    if (!joint.mimic.empty()) {
      text += fmt::format("    <mimic joint=\"{}\" multiplier=\"{}\" offset=\"{}\"/>\n", xml_escaped(joint.mimic),
                          joint.mimic_multiplier, joint.mimic_offset);
    }
    text += "  </joint>\n";
  }
  files[stem + ".urdf"] = text + "</robot>\n";
  return files;
}

}  // namespace palpate::io
