// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/foot_error.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "palpate/estimation/mesh_error.hpp"
#include "palpate/geometry/union_find.hpp"

namespace palpate::estimation {
namespace {

constexpr double flat = 1e-4;  // of the surface's size: what lies in the plane

struct Foot {
  double area_m2 = 0;
  Vec3 middle_m = Vec3::Zero();
  double radius_m() const { return std::sqrt(area_m2 / M_PI); }
};

/// Triangles in the plane that share a vertex are of one foot.
std::vector<Foot> feet_of(const TriMesh& surface, const Plane& plane) {
  const double size_m = (surface.vertices_m.colwise().maxCoeff() - surface.vertices_m.colwise().minCoeff()).norm();
  const auto vertex = [&](Index t, int k) { return Vec3(surface.vertices_m.row(surface.triangles(t, k))); };
  const auto in_plane = [&](const Vec3& p) { return std::abs(plane.normal.dot(p - plane.point_m)) < flat * size_m; };
  std::vector<Index> lying;
  geometry::UnionFind together(surface.vertices_m.rows());
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    if (!in_plane(vertex(t, 0)) || !in_plane(vertex(t, 1)) || !in_plane(vertex(t, 2))) continue;
    lying.push_back(t);
    for (int k = 1; k < 3; ++k) together.join(surface.triangles(t, 0), surface.triangles(t, k));
  }
  std::map<Index, Foot> feet;
  for (const Index t : lying) {
    const double area_m2 = 0.5 * (vertex(t, 1) - vertex(t, 0)).cross(vertex(t, 2) - vertex(t, 0)).norm();
    Foot& foot = feet[together.root(surface.triangles(t, 0))];
    foot.area_m2 += area_m2;
    foot.middle_m += area_m2 * (vertex(t, 0) + vertex(t, 1) + vertex(t, 2)) / 3;
  }
  std::vector<Foot> out;
  for (auto& [root, foot] : feet) {
    if (!(foot.area_m2 > 0)) continue;
    foot.middle_m /= foot.area_m2;
    out.push_back(foot);
  }
  return out;
}

}  // namespace

TetMesh with_foot_moved(const TetMesh& mesh, const TriMesh& surface, const FootDoubt& doubt, double lean_rad, const Vec3& aside) {
  TetMesh moved = mesh;
  const std::vector<Foot> feet = feet_of(surface, doubt.plane);
  for (Index i = 0; !feet.empty() && i < mesh.nodes_m.rows(); ++i) {
    const Vec3 node = mesh.nodes_m.row(i);
    const double height_m = doubt.plane.normal.dot(node - doubt.plane.point_m), depth_m = doubt.strip_m - height_m;
    if (depth_m <= 0) continue;
    const Vec3 below = node - height_m * doubt.plane.normal;
    const Foot& foot = *std::min_element(feet.begin(), feet.end(), [&](const Foot& a, const Foot& b) {
      return (below - a.middle_m).squaredNorm() < (below - b.middle_m).squaredNorm();
    });
    moved.nodes_m.row(i) += (depth_m * (lean_rad / foot.radius_m() * (below - foot.middle_m) + aside)).transpose();
  }
  return moved;
}

std::optional<std::vector<AnswerShift>> foot_effect(const FootDoubt& doubt, const Recording& recording, const SimulatedObject& object,
                                                    const Objective& objective, const Optimum& optimum, const Loss& loss,
                                                    const FitOptions& options, const OnProgress& progress) {
  if (feet_of(object.surface.rest(), doubt.plane).empty()) return std::nullopt;
  const Vec3 along = doubt.plane.normal.unitOrthogonal(), across = doubt.plane.normal.cross(along);
  std::vector<AnswerShift> out;
  for (const auto& [lean_rad, aside] : {std::pair<double, Vec3>{foot_lean_std_rad, Vec3::Zero()}, {0, foot_aside_std_rad * along}, {0, foot_aside_std_rad * across}}) {
    FinerModel other;
    other.recording = recording, other.object = object;
    other.edge_share = 0;  // the change is all that is asked for
    other.object.mesh = with_foot_moved(object.mesh, object.surface.rest(), doubt, lean_rad, aside);
    const auto shift = mesh_shift(recording, object, objective, optimum, loss, other, options, progress);
    if (!shift) return std::nullopt;
    out.push_back(*shift);
  }
  return out;
}

}  // namespace palpate::estimation
