// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/urdf.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/io/scanner.hpp"
#include "palpate/io/xml.hpp"

namespace palpate::io {
namespace {

namespace fs = std::filesystem;

/// RFC 3986: %20 is a space.
std::string without_percent(const std::string& url) {
  std::string out;
  for (std::size_t i = 0; i < url.size(); ++i) {
    unsigned value = 0;
    const char* const from = url.data() + i + 1;
    if (url[i] == '%' && i + 2 < url.size() && std::from_chars(from, from + 2, value, 16).ptr == from + 2) {
      out += static_cast<char>(value);
      i += 2;
    } else {
      out += url[i];
    }
  }
  return out;
}

class UrdfReader {
 public:
  UrdfReader(std::string name, fs::path mesh_root, std::vector<std::string>* left_out)
      : name_(std::move(name)), mesh_root_(std::move(mesh_root)), left_out_(left_out) {}

  RobotModel read(std::string_view bytes) {
    const XmlElement root = parse_xml(bytes, name_);
    if (root.name != "robot")
      fail(root, "the root element is '" + root.name.substr(0, 40) + "', a URDF has 'robot'; expand xacro files first");
    robot_.name = root.attribute("name");
    for (const XmlElement& child : root.children) {
      if (child.name == "link") read_link(child);
      if (child.name == "joint") read_joint(child);
    }
    if (robot_.links.empty()) fail(root, "the robot has no link");
    check_tree(root);
    return std::move(robot_);
  }

 private:
  [[noreturn]] void fail(const XmlElement& element, const std::string& what) const {
    throw Error(what, name_ + ":" + std::to_string(element.line));
  }

  std::string need(const XmlElement& element, const std::string& key) const {
    const std::string value = element.attribute(key);
    if (value.empty()) fail(element, "element '" + element.name + "' has no " + key);
    return value;
  }

  double number(const XmlElement& element, const std::string& key, double otherwise) const {
    const std::string text = element.attribute(key);
    if (text.empty()) return otherwise;
    const auto value = parse_number(trimmed(text));
    if (!value || !std::isfinite(*value)) fail(element, key + " '" + text.substr(0, 40) + "' is not a finite number");
    return *value;
  }

  Vec3 vector(const XmlElement& element, const std::string& key, const Vec3& otherwise) const {
    const std::string text = element.attribute(key);
    if (text.empty()) return otherwise;
    Scanner words(text, name_);
    Vec3 result;
    for (int axis = 0; axis < 3; ++axis) {
      const auto value = parse_number(words.peek_word());
      if (!value || !std::isfinite(*value))
        fail(element, key + " '" + text.substr(0, 40) + "' must be three finite numbers");
      result[axis] = *value;
      words.word(key);
    }
    if (!words.at_end()) fail(element, key + " must be three numbers");
    return result;
  }

  /// rpy: rotations about the fixed axes x, y, z in this order.
  Pose origin(const XmlElement& parent) const {
    Pose pose = Pose::Identity();
    const XmlElement* element = parent.child("origin");
    if (element == nullptr) return pose;
    const Vec3 rpy = vector(*element, "rpy", Vec3::Zero());
    pose.linear() = (Eigen::AngleAxisd(rpy.z(), Vec3::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Vec3::UnitY()) *
                     Eigen::AngleAxisd(rpy.x(), Vec3::UnitX()))
                        .toRotationMatrix();
    pose.translation() = vector(*element, "xyz", Vec3::Zero());
    return pose;
  }

  TriMesh mesh(const XmlElement& element) const {
    std::string file = need(element, "filename");
    const bool is_whole_path = file.starts_with("file://");
    for (const char* scheme : {"package://", "file://"}) {
      if (file.rfind(scheme, 0) == 0) file = file.substr(std::string(scheme).size());
    }
    if (is_whole_path) file = without_percent(file);
    const fs::path relative = fs::path(file).relative_path();
    if (std::find(relative.begin(), relative.end(), "..") != relative.end())
      fail(element, "mesh '" + file + "' lies outside the robot's folder");
    fs::path without_package;
    for (auto part = relative.begin(); part != relative.end(); ++part) {
      if (part != relative.begin()) without_package /= *part;
    }
    std::vector<fs::path> names{relative, without_package};
    // A whole path names another machine's folder, perhaps: what it ends with lies beside the URDF.
    for (fs::path rest = without_package; is_whole_path && !rest.empty(); names.push_back(rest)) {
      fs::path shorter;
      for (auto part = rest.begin(); part != rest.end(); ++part)
        if (part != rest.begin()) shorter /= *part;
      rest = shorter;
    }
    for (const fs::path& one : names) {
      std::error_code code;
      if (one.empty() || !fs::is_regular_file(mesh_root_ / one, code)) continue;
      TriMesh result = read_tri_mesh(mesh_root_ / one);
      const Vec3 scale = vector(element, "scale", Vec3::Ones());
      result.vertices_m.array().rowwise() *= scale.transpose().array();
      if (scale.prod() < 0) result.triangles.col(1).swap(result.triangles.col(2));
      return result;
    }
    fail(element,
         "mesh '" + relative.string() + "' is not under " + mesh_root_.string() + "; copy the meshes beside the URDF");
  }

  std::optional<RobotShape> shape(const XmlElement& element) const {
    const XmlElement* geometry = element.child("geometry");
    if (geometry == nullptr || geometry->children.empty()) fail(element, "element '" + element.name + "' has no geometry");
    const XmlElement& kind = geometry->children.front();
    RobotShape result;
    result.T_link_shape = origin(element);
    const auto positive = [&](const std::string& key) {
      const double value = number(kind, key, 0);
      if (!(value > 0)) fail(kind, key + " must be larger than 0");
      return value;
    };
    if (kind.name == "mesh") {
      result.kind = RobotShape::Kind::mesh;
      try {
        result.mesh = mesh(kind);
      } catch (const Error& error) {
        if (left_out_ == nullptr) throw;
        left_out_->push_back("a " + element.name + " shape of the robot is left out (" + error.what() + ")");
        return std::nullopt;
      }
    } else if (kind.name == "box") {
      result.kind = RobotShape::Kind::box;
      result.size_m = vector(kind, "size", Vec3::Zero());
      if (!(result.size_m.minCoeff() > 0)) fail(kind, "size must be larger than 0");
    } else if (kind.name == "cylinder") {
      result.kind = RobotShape::Kind::cylinder;
      result.size_m = {positive("radius"), positive("length"), 0};
    } else if (kind.name == "sphere") {
      result.kind = RobotShape::Kind::sphere;
      result.size_m = {positive("radius"), 0, 0};
    } else {
      fail(kind, "geometry '" + kind.name.substr(0, 40) + "' is unknown: mesh, box, cylinder and sphere are read");
    }
    return result;
  }

  void read_link(const XmlElement& element) {
    RobotLink link;
    link.name = need(element, "name");
    for (const RobotLink& other : robot_.links) {
      if (other.name == link.name) fail(element, "link '" + link.name + "' is there twice");
    }
    for (const XmlElement& child : element.children) {
      if (child.name != "visual" && child.name != "collision") continue;
      const auto one = shape(child);
      if (one) (child.name == "visual" ? link.visual : link.collision).push_back(*one);
    }
    robot_.links.push_back(std::move(link));
  }

  void read_joint(const XmlElement& element) {
    RobotJoint joint;
    joint.name = need(element, "name");
    for (const RobotJoint& other : robot_.joints) {
      if (other.name == joint.name) fail(element, "joint '" + joint.name + "' is there twice");
    }
    const std::string type = need(element, "type");
    if (type == "revolute")
      joint.kind = RobotJoint::Kind::revolute;
    else if (type == "continuous")
      joint.kind = RobotJoint::Kind::continuous;
    else if (type == "prismatic")
      joint.kind = RobotJoint::Kind::prismatic;
    else if (type == "fixed")
      joint.kind = RobotJoint::Kind::fixed;
    else
      fail(element,
           "joints of type '" + type.substr(0, 40) + "' are not read: revolute, continuous, prismatic and fixed are");
    const XmlElement* parent = element.child("parent");
    const XmlElement* child = element.child("child");
    if (parent == nullptr || child == nullptr) fail(element, "joint '" + joint.name + "' needs a parent and a child");
    joint.parent = need(*parent, "link");
    joint.child = need(*child, "link");
    joint.T_parent_joint = origin(element);
    if (const XmlElement* axis = element.child("axis")) {
      joint.axis = vector(*axis, "xyz", Vec3::UnitX());
      if (joint.axis.norm() < 1e-9) fail(*axis, "the axis of joint '" + joint.name + "' has length 0");
      joint.axis.normalize();
    }
    const bool limited = joint.kind == RobotJoint::Kind::revolute || joint.kind == RobotJoint::Kind::prismatic;
    const XmlElement* limit = element.child("limit");
    if (limited && limit == nullptr) fail(element, "joint '" + joint.name + "' has no limit");
    if (limit != nullptr) {
      joint.lower = number(*limit, "lower", 0);
      joint.upper = number(*limit, "upper", 0);
      joint.velocity = number(*limit, "velocity", 0);
      if (joint.lower > joint.upper) fail(*limit, "lower is above upper");
    }
    if (const XmlElement* mimic = element.child("mimic")) {
      joint.mimic = need(*mimic, "joint");
      joint.mimic_multiplier = number(*mimic, "multiplier", 1);
      joint.mimic_offset = number(*mimic, "offset", 0);
    }
    robot_.joints.push_back(std::move(joint));
  }

  void check_tree(const XmlElement& root) const {
    std::map<std::string, std::string> parent_of;
    const auto has_link = [&](const std::string& link) {
      return std::any_of(robot_.links.begin(), robot_.links.end(), [&](const RobotLink& one) { return one.name == link; });
    };
    for (const RobotJoint& joint : robot_.joints) {
      for (const std::string& link : {joint.parent, joint.child}) {
        if (!has_link(link)) fail(root, "joint '" + joint.name + "' refers to link '" + link + "', which is not there");
      }
      if (!parent_of.emplace(joint.child, joint.parent).second) fail(root, "link '" + joint.child + "' has two parents");
      const bool mimics_known =
          joint.mimic.empty() || std::any_of(robot_.joints.begin(), robot_.joints.end(),
                                             [&](const RobotJoint& one) { return one.name == joint.mimic; });
      if (!mimics_known) fail(root, "joint '" + joint.name + "' mimics '" + joint.mimic + "', which is not there");
    }
    std::size_t roots = 0;
    for (const RobotLink& link : robot_.links) {
      if (parent_of.count(link.name) == 0) ++roots;
      std::string at = link.name;
      for (std::size_t steps = 0; parent_of.count(at) > 0; at = parent_of[at]) {
        if (++steps > robot_.links.size()) fail(root, "the links form a loop at '" + at + "'");
      }
    }
    if (roots != 1) fail(root, "the links form " + std::to_string(roots) + " trees; connect them by joints");
  }

  std::string name_;
  fs::path mesh_root_;
  std::vector<std::string>* left_out_;
  RobotModel robot_;
};

}  // namespace

RobotModel parse_urdf(std::string_view bytes, const std::string& name, const fs::path& mesh_root,
                      std::vector<std::string>* left_out) {
  return UrdfReader(name, mesh_root, left_out).read(bytes);
}

RobotModel read_urdf(const fs::path& path) { return parse_urdf(read_file(path), path.string(), path.parent_path()); }

}  // namespace palpate::io
