// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/geometry/winding_number.hpp"

namespace palpate::geometry {

/// A triangle soup with all triangles turned outward: welded, without copies, faces that parts have in common and triangles
/// without area.
struct OrientedSurface {
  TriMesh mesh;
  Index flipped = 0;                  ///< triangles that were turned round
  Index dropped = 0;                  ///< copies, shared faces, triangles without area
  Index patches = 0;                  ///< pieces across whose edges the orientation could be carried
  bool closed = false;                ///< triangles run along every edge as often in one direction as in the other
  std::vector<double> cover_width_m;  ///< of the mesh's last triangles, which close small holes: the width of the hole
};

/// Orientation is carried over edges with two triangles; when the input was inconsistent, every patch is then turned so that
/// most of the rays cast from its two sides agree on what is inside by the parity of their crossings. A consistent input
/// keeps its orientation, unless all of it is inside out, or a closed part of it that no other part surrounds. Small holes are then closed.
OrientedSurface orient(const TriMesh& mesh);

/// A soup seen as a solid: inside is where its winding number is above one half.
class Solid {
 public:
  /// @throws Error when no triangle with an area is left.
  explicit Solid(const TriMesh& soup);

  bool inside(const Vec3& point_m) const { return winding_(point_m) > 0.5; }
  /// Distance to the nearest triangle, negative inside.
  double signed_distance(const Vec3& point_m) const;
  ClosestPoint closest(const Vec3& point_m, Index hint = -1) const { return tree_.closest(point_m, hint); }
  bool within(const Vec3& point_m, double squared_m2, Index hint = -1) const {
    return tree_.within(point_m, squared_m2, hint);
  }
  Vec3 normal(Index triangle) const { return normals_.row(triangle).transpose(); }
  /// Where the segment from an inside to an outside point leaves the solid, as a share of its length.
  double leaves(const Vec3& inside_m, const Vec3& outside_m) const;
  /// How much of the solid's boundary a triangle is there: 0 where it is hidden within another part, one half where two
  /// parts have a face in common, otherwise 1.
  double boundary_share(const Vec3& point_on_triangle_m, Index triangle) const;

  const TriMesh& surface() const { return tree_.mesh(); }
  const TriangleTree& tree() const { return tree_; }
  const OrientedSurface& orientation() const { return oriented_; }  ///< without its mesh
  bool watertight() const { return watertight_; }                   ///< once small holes are closed
  /// Width of the hole that this triangle closes; 0 for a given one.
  double hole_width_m(Index triangle) const {
    const auto first = static_cast<Index>(normals_.rows()) - static_cast<Index>(oriented_.cover_width_m.size());
    return triangle < first ? 0 : oriented_.cover_width_m[triangle - first];
  }
  /// Of watertight surfaces: what lies within several parts of the soup counts several times.
  double signed_volume_m3() const { return volume_m3_; }
  double area_m2() const { return area_m2_; }
  double diagonal_m() const { return diagonal_m_; }
  const Vec3& min_m() const { return min_m_; }
  const Vec3& max_m() const { return max_m_; }

 private:
  OrientedSurface oriented_;
  TriangleTree tree_;
  WindingNumber winding_;
  Points normals_;
  bool watertight_ = false;
  double volume_m3_ = 0, area_m2_ = 0;
  double diagonal_m_ = 0;
  Vec3 min_m_, max_m_;
};

}  // namespace palpate::geometry
