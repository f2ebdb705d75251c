// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cctype>
#include <cmath>
#include <functional>
#include <system_error>

#include "palpate/io/file.hpp"
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

/// RFC 3986: what is no letter, digit or one of a few signs stands as %XX.
std::string file_url(const std::filesystem::path& absolute) {
  std::string url = "file://";
  for (const char one : absolute.generic_string()) {
    const bool plain = std::isalnum(static_cast<unsigned char>(one)) != 0 || std::string_view("/-._~").find(one) != std::string_view::npos;
    url += plain ? std::string(1, one) : fmt::format("%{:02X}", static_cast<unsigned char>(one));
  }
  return url;
}

/// @param keep  takes a mesh of that number, and says by what name the text is to call it
std::string urdf_text(const RobotModel& robot, const std::function<std::string(int, const MeshData&)>& keep) {
  std::string text = "<?xml version=\"1.0\"?>\n<robot name=\"" + xml_escaped(robot.name) + "\">\n";
  int meshes = 0;
  const auto shape_text = [&](const RobotShape& shape, const char* element) {
    std::string geometry;
    switch (shape.kind) {
      case RobotShape::Kind::mesh: {
        MeshData mesh;
        mesh.points_m = shape.mesh.vertices_m;
        mesh.triangles = shape.mesh.triangles;
        geometry = fmt::format("<mesh filename=\"{}\"/>", xml_escaped(keep(meshes++, mesh)));
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
  return text + "</robot>\n";
}

}  // namespace

std::map<std::string, std::string> urdf_files(const RobotModel& robot, const std::string& stem) {
  std::map<std::string, std::string> files;
  const std::string text = urdf_text(robot, [&](int number, const MeshData& mesh) {
    const std::string file = fmt::format("{}_meshes/{}.ply", stem, number);
    files[file] = mesh_format_named("ply").write(mesh);
    return file;
  });
  files[stem + ".urdf"] = text;
  return files;
}

std::string urdf_for_viewers(const RobotModel& robot, const std::filesystem::path& folder) {
  const std::filesystem::path there = folder / "robot_view";
  std::error_code code;
  std::filesystem::create_directories(there, code);
  return urdf_text(robot, [&](int number, const MeshData& mesh) {
    const std::filesystem::path file = there / fmt::format("{}.obj", number);
    write_file(file, mesh_format_named("obj").write(mesh));
    return file_url(std::filesystem::absolute(file).lexically_normal());
  });
}

}  // namespace palpate::io
