// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/robot_mask.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "palpate/core/error.hpp"

namespace palpate::sensing {
namespace {

TriMesh box_mesh(const Vec3& size) {
  TriMesh mesh;
  mesh.vertices_m.resize(8, 3);
  for (int k = 0; k < 8; ++k)
    mesh.vertices_m.row(k) = 0.5 * size.cwiseProduct(Vec3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
  mesh.triangles.resize(12, 3);
  mesh.triangles << 0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7,
      5;
  return mesh;
}

// A ring polygon of n corners lies outside its circle when its corners do by 1 / cos(pi / n).
TriMesh turned_mesh(const std::vector<Vec2>& profile, int sectors) {
  TriMesh mesh;
  const auto rings = Eigen::Index(profile.size());
  mesh.vertices_m.resize(rings * sectors, 3);
  mesh.triangles.resize(2 * (rings - 1) * sectors, 3);
  const double outside = 1 / std::cos(M_PI / sectors);
  for (Eigen::Index r = 0; r < rings; ++r)
    for (Eigen::Index s = 0; s < sectors; ++s) {
      const double angle = 2 * M_PI * double(s) / sectors, radius = profile[std::size_t(r)].x() * outside;
      mesh.vertices_m.row(r * sectors + s) << radius * std::cos(angle), radius * std::sin(angle),
          profile[std::size_t(r)].y();
    }
  Eigen::Index t = 0;
  for (Eigen::Index r = 0; r + 1 < rings; ++r)
    for (Eigen::Index s = 0; s < sectors; ++s) {
      const auto a = Index(r * sectors + s), b = Index(r * sectors + (s + 1) % sectors);
      mesh.triangles.row(t++) << a, b, b + sectors;
      mesh.triangles.row(t++) << a, b + sectors, a + sectors;
    }
  return mesh;
}

bool is_around(const TriMesh& mesh, const Vec3& point_m) {
  if (mesh.vertices_m.rows() == 0) return false;
  const Vec3 low = mesh.vertices_m.colwise().minCoeff(), high = mesh.vertices_m.colwise().maxCoeff();
  return (point_m.array() >= low.array()).all() && (point_m.array() <= high.array()).all();
}

}  // namespace

TriMesh shape_mesh(const RobotShape& shape) {
  const auto positive = [&](int count) {
    for (int k = 0; k < count; ++k)
      if (!(shape.size_m(k) > 0)) throw Error("must be positive", "shape.size_m");
  };
  switch (shape.kind) {
    case RobotShape::Kind::box:
      positive(3);
      return box_mesh(shape.size_m);
    case RobotShape::Kind::cylinder: {
      positive(2);
      const double r = shape.size_m(0), h = 0.5 * shape.size_m(1);
      return turned_mesh({{0, -h}, {r, -h}, {r, h}, {0, h}}, 32);
    }
    case RobotShape::Kind::sphere: {
      positive(1);
      constexpr int rings = 16;
      std::vector<Vec2> profile;
      const double radius = shape.size_m(0) / std::cos(0.5 * M_PI / rings);
      for (int k = 0; k <= rings; ++k)
        profile.emplace_back(radius * std::sin(M_PI * k / rings), -radius * std::cos(M_PI * k / rings));
      return turned_mesh(profile, 32);
    }
    case RobotShape::Kind::mesh:
      break;
  }
  if (shape.mesh.triangles.rows() == 0) throw Error("has no triangle", "shape.mesh");
  const Index vertices = Index(shape.mesh.vertices_m.rows());
  if (shape.mesh.triangles.minCoeff() < 0 || shape.mesh.triangles.maxCoeff() >= vertices)
    throw Error("names a vertex that does not exist", "shape.mesh");
  return shape.mesh;
}

bool has_shapes(const RobotModel& robot) {
  return std::any_of(robot.links.begin(), robot.links.end(),
                     [](const RobotLink& link) { return !link.visual.empty() || !link.collision.empty(); });
}

RobotMask::RobotMask(RobotModel robot, RobotMaskOptions options)
    : kinematics_(std::move(robot)), options_(std::move(options)) {
  check(options_.margins);
  if (!(options_.joint_std_rad >= 0)) throw Error("must not be negative", "RobotMaskOptions.joint_std_rad");
  if (!(options_.base_std_m >= 0)) throw Error("must not be negative", "RobotMaskOptions.base_std_m");
  if (!(options_.pose_sigmas >= 0)) throw Error("must not be negative", "RobotMaskOptions.pose_sigmas");
  const std::vector<RobotLink>& links = kinematics_.robot().links;
  for (std::size_t i = 0; i < links.size(); ++i) {
    const bool visual = options_.geometry == RobotGeometry::visual;
    const auto& wanted = visual ? links[i].visual : links[i].collision;
    const auto& shapes = wanted.empty() ? (visual ? links[i].collision : links[i].visual) : wanted;
    TriMesh whole;
    for (const RobotShape& shape : shapes) {
      TriMesh part;
      try {
        part = shape_mesh(shape);
      } catch (const Error& error) {
        throw Error(error.message(),
                    "robot '" + kinematics_.robot().name + "', link '" + links[i].name + "', " + error.where());
      }
      const Eigen::Index old_vertices = whole.vertices_m.rows(), old_triangles = whole.triangles.rows();
      whole.vertices_m.conservativeResize(old_vertices + part.vertices_m.rows(), 3);
      whole.triangles.conservativeResize(old_triangles + part.triangles.rows(), 3);
      for (Eigen::Index v = 0; v < part.vertices_m.rows(); ++v)
        whole.vertices_m.row(old_vertices + v) = shape.T_link_shape * Vec3(part.vertices_m.row(v));
      whole.triangles.bottomRows(part.triangles.rows()) = (part.triangles.array() + Index(old_vertices)).matrix();
    }
    if (whole.triangles.rows() == 0) continue;
    Eigen::Index farthest = 0;
    whole.vertices_m.rowwise().squaredNorm().maxCoeff(&farthest);
    farthest_m_.emplace_back(whole.vertices_m.row(farthest));
    links_.push_back(Index(i));
    meshes_.push_back(std::move(whole));
  }
  if (links_.empty())
    throw Error("has neither visual nor collision geometry: nothing to mask", "robot '" + kinematics_.robot().name + "'");
}

Index RobotMask::triangle_count() const {
  Index count = 0;
  for (const TriMesh& mesh : meshes_) count += Index(mesh.triangles.rows());
  return count;
}

DepthImage RobotMask::render(const std::vector<Pose>& link_poses, const Camera& camera, const Pose& T_base_camera,
                             const Pose& T_base_root) const {
  if (link_poses.size() != kinematics_.robot().links.size())
    throw Error("needs one pose a link, as Kinematics::link_poses gives them", "link_poses");
  std::vector<PosedMesh> bodies;
  for (std::size_t k = 0; k < links_.size(); ++k)
    bodies.push_back({&meshes_[k], T_base_root * link_poses[std::size_t(links_[k])]});
  return render_depth(bodies, camera, T_base_camera);
}

RobotMask::PosedLink RobotMask::posed(std::size_t k, const std::vector<Pose>& link_poses) const {
  return {k, link_poses[std::size_t(links_[k])],
          kinematics_.position_std_m(link_poses, links_[k], farthest_m_[k], options_.joint_std_rad)};
}

std::vector<RobotMask::PosedLink> RobotMask::known_links(const std::vector<std::string>& joint_names,
                                                         const std::vector<double>& joints) const {
  const std::vector<std::optional<Pose>> known = kinematics_.known_link_poses(joint_names, joints);
  std::vector<Pose> poses;
  for (const std::optional<Pose>& one : known) poses.push_back(one.value_or(Pose::Identity()));
  std::vector<PosedLink> links;
  for (std::size_t k = 0; k < links_.size(); ++k)
    if (known[std::size_t(links_[k])]) links.push_back(posed(k, poses));
  return links;
}

MaskImage RobotMask::mask(const DepthFrame& frame, const std::vector<std::string>& joint_names,
                          const std::vector<double>& joints, const Pose& T_base_root) const {
  const std::vector<Pose> poses = kinematics_.link_poses(joint_names, joints);
  std::vector<PosedLink> links;
  for (std::size_t k = 0; k < links_.size(); ++k) links.push_back(posed(k, poses));
  return mask_posed(frame, links, T_base_root);
}

MaskImage RobotMask::mask_known(const DepthFrame& frame, const std::vector<std::string>& joint_names,
                                const std::vector<double>& joints, const Pose& T_base_root) const {
  return mask_posed(frame, known_links(joint_names, joints), T_base_root);
}

MaskImage RobotMask::mask_posed(const DepthFrame& frame, const std::vector<PosedLink>& links, const Pose& T_base_root) const {
  double std_m = 0;  // of the worst link
  std::vector<PosedMesh> bodies;
  for (const PosedLink& link : links) {
    const TriMesh& mesh = meshes_[link.shaped];
    std_m = std::max(std_m, link.position_std_m);
    bodies.push_back({&mesh, T_base_root * link.T_root_link});
    // The camera's own housing is around it, and would hide everything.
    constexpr double housing_m = 0.05;
    if (is_around(mesh, bodies.back().T_base_mesh.inverse() * Vec3(frame.T_base_camera.translation()))) bodies.back().near_m = housing_m;
  }
  const double pose_margin = options_.pose_sigmas * std::hypot(std_m, options_.base_std_m, frame.pose_std_m);
  RenderMaskOptions margins = options_.margins;
  margins.lateral_margin_m += pose_margin;
  margins.depth_margin_m += pose_margin;
  return mask_rendered(frame, render_depth(bodies, frame.camera, frame.T_base_camera), margins);
}

}  // namespace palpate::sensing
