// SPDX-License-Identifier: Apache-2.0
// Rays that start at one point, as those of a camera do. They are sorted once into cells of a plane before the eye (the perspective
// grid of Hunt and Mark 2008, of rays and not of triangles); a surface that moves before them is drawn on that plane, each triangle
// on the few rays of the cells that it covers. Nothing is built for the surface, and what has more triangles than there are rays
// costs no more than a look at each of them.
#pragma once

#include <optional>
#include <vector>

#include "palpate/geometry/surface_edges.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::geometry {

/// Exact in double. Const queries are thread-safe.
class RayBundle {
 public:
  /// @param directions  of any length, in a frame that goes with the eye. One that is zero or not finite meets nothing.
  explicit RayBundle(const Points& directions);

  /// First hits, both sides of a triangle count: the digits of TriangleTree::cast. Of triangles that are hit at one range one that faces
  /// the eye is named, and of those the first.
  /// @param turn  from the directions' frame to that of the vertices
  /// @param skipped  a ray: nonzero where it is not asked about; empty: all are
  /// @returns a ray each, triangle -1 for a miss; nothing where rays or surface reach around the eye, or a coordinate is not finite:
  ///          then a tree must be asked
  std::optional<std::vector<RayHit>> meet(const Points& vertices_m, const Triangles& triangles, const Vec3& eye_m, const Mat3& turn,
                                          const std::vector<char>& skipped = {}) const;

  /// Rays that pass an outline closely: an edge between a triangle that faces the eye and one that does not, or where the surface
  /// ends, unless it lies behind what the ray meets. There a camera's pixel mixes both sides.
  /// @param edges  of the triangles (surface_edges)
  /// @param hits   what meet() said of the same surface
  /// @param margin_rad  how closely; small
  /// @returns a ray each, nonzero for those that hit and lie so; nothing where meet() would say nothing
  std::optional<std::vector<char>> beside_outline(const Points& vertices_m, const Triangles& triangles,
                                                  const std::vector<SurfaceEdge>& edges, const Vec3& eye_m, const Mat3& turn,
                                                  const std::vector<RayHit>& hits, double margin_rad) const;

 private:
  struct Drawing;

  Points directions_;
  bool in_view_ = false;
  Vec3 axis_, right_, down_;
  double left_ = 0, top_ = 0, cells_per_slope_ = 0;  ///< the plane is one away from the eye: its coordinates are slopes
  Index columns_ = 0, rows_ = 0;
  std::vector<Index> first_;  ///< of a cell among the sorted rays, row after row; one more at the end
  /// Rays in the order of their cells: which one, where in the plane (in cells), and how far along the axis a unit of it leads.
  std::vector<Index> ray_;
  std::vector<double> u_, v_, ahead_;
};

}  // namespace palpate::geometry
