// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/rigid_tool.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "palpate/core/error.hpp"
#include "palpate/estimation/load_columns.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::estimation {
namespace {

constexpr int across = 24;  // samples along the edge of a triangle near the tool

/// The tool and the surface near it, along the push.
class GapAlong {
 public:
  GapAlong(const TetMesh& mesh, const fem::RigidShape& shape, const Pose& pose) : shape_(shape) {
    const Pose T_tool_base = pose.inverse();
    const Triangles triangles = fem::boundary_triangles(mesh);
    const Vec3 centre = pose * shape.bounding_centre_m();
    for (Index t = 0; t < triangles.rows(); ++t) {
      const Vec3 a = mesh.nodes_m.row(triangles(t, 0)), b = mesh.nodes_m.row(triangles(t, 1)),
                 c = mesh.nodes_m.row(triangles(t, 2));
      const double size = std::max({(b - a).norm(), (c - a).norm(), (c - b).norm()});
      if (((a + b + c) / 3 - centre).norm() > 2 * shape.bounding_radius_m() + size) continue;
      cell_m_ = std::max(cell_m_, size / across);
      for (int i = 0; i <= across; ++i)
        for (int j = 0; i + j <= across; ++j)
          points_.push_back(T_tool_base * (a + (b - a) * i / double(across) + (c - a) * j / double(across)));
    }
  }
  bool misses() const { return points_.empty(); }
  /// Does the tool reach into the object, moved so far along the push?
  bool reaches_in(double travel_m) const {
    fem::ShapePoint point;
    for (const Vec3& y : points_)
      if (shape_.at(y - Vec3(0, 0, travel_m), cell_m_, point) && point.gap_m < 0) return true;
    return false;
  }

 private:
  const fem::RigidShape& shape_;
  double cell_m_ = 0;
  std::vector<Vec3> points_;  ///< in the tool's frame
};

}  // namespace

bool touches_rigidly(const Tool& tool) {
  if (tool.shape == ToolShape::platen) return tool.contact == ContactLaw::friction;
  return tool.shape != ToolShape::vertices;
}

Vec3 push_direction(const Tool& tool, const Load& load) {
  return (tool.shape == ToolShape::platen ? tool.plane.normal : load.direction).normalized();
}

fem::RigidContact rigid_tool(const TetMesh& mesh, const Tool& tool, const Load& load) {
  fem::RigidContact contact;
  contact.name = tool.name;
  contact.shape = fem::shape_of(tool);
  contact.friction_coefficient = tool.friction_coefficient;
  contact.law = tool.contact == ContactLaw::friction       ? fem::Touch::friction
                : tool.contact == ContactLaw::frictionless ? fem::Touch::frictionless
                                                           : fem::Touch::sticking;
  const Vec3 direction = push_direction(tool, load);
  if (tool.shape == ToolShape::platen) {
    contact.T_base_tool = fem::tool_pose(tool.plane.point_m, direction);
    const double diagonal_m = (mesh.nodes_m.colwise().maxCoeff() - mesh.nodes_m.colwise().minCoeff()).norm();
    contact.seat_m = std::max(1e-6, 1e-4 * diagonal_m);
    return contact;
  }
  contact.T_base_tool = fem::tool_pose(touched_m(load), direction, tool.axis);
  const GapAlong gap(mesh, *contact.shape, contact.T_base_tool);
  if (gap.misses()) throw Error("lies nowhere near the object; check its loads' contact_m", "tools." + tool.name);
  // From twice its size outside, where it touches nothing, inwards.
  const double reach_m = 2 * contact.shape->bounding_radius_m();
  const double stride_m = reach_m / 100;
  double outside = -reach_m, inside = outside;
  while (!gap.reaches_in(inside)) {
    outside = inside;
    inside += stride_m;
    if (inside > reach_m)
      throw Error("misses the object along the push through contact_m; check direction and contact_m", "tools." + tool.name);
  }
  for (int k = 0; k < 40; ++k) {
    const double middle = 0.5 * (outside + inside);
    (gap.reaches_in(middle) ? inside : outside) = middle;
  }
  contact.T_base_tool.translation() += outside * direction;
  return contact;
}

Vec3 way_along_surface(const TetMesh& mesh, const Tool& tool, const Load& load, const Vec3& tangent) {
  const Vec3 direction = push_direction(tool, load);
  const double size_m = tool.radius_m > 0 ? tool.radius_m : rigid_tool(mesh, tool, load).shape->bounding_radius_m();
  // Surfaces of a mesh are smooth on the scale of the tool only. At an edge there is one side to go to, or none.
  const double h = size_m / 8;
  const auto begins_m = [&](double aside_m) -> std::optional<double> {
    Load there = load;
    there.contact_m += aside_m * tangent;
    try {
      return direction.dot(rigid_tool(mesh, tool, there).T_base_tool.translation());
    } catch (const Error&) {
      return std::nullopt;
    }
  };
  const auto ahead = begins_m(h), behind = begins_m(-h);
  return tangent + (ahead && behind ? (*ahead - *behind) / (2 * h) : 0) * direction;
}

}  // namespace palpate::estimation
