// SPDX-License-Identifier: Apache-2.0
// Rays that start at one point, as those of a camera do. What may be met in a direction is sorted into cells of a plane before the eye
// (the perspective grid of Hunt and Mark 2008): a ray asks the few triangles of its cell, several times as fast as a hierarchy
// is descended, and a moved surface is sorted anew in less time than its hierarchy takes to be refitted.
#pragma once

#include <optional>
#include <vector>

#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::geometry {

/// Exact in double. Const queries are thread-safe.
class PerspectiveGrid {
 public:
  /// @param triangles  of these vertices; must live as long as this does
  PerspectiveGrid(const Points& vertices_m, const Triangles& triangles, const Vec3& eye_m);

  /// False where the surface reaches around the eye or a coordinate is not finite: then nothing may be asked.
  bool in_view() const { return in_view_; }

  /// First hit of a ray from the eye, both sides of a triangle count: the digits of TriangleTree::cast. Of triangles that are hit at one
  /// range one that faces the eye is named, and of those the first.
  std::optional<RayHit> cast(const Vec3& direction) const;

 private:
  void sort_into_cells(const VectorX& u, const VectorX& v, const VectorX& depth);

  const Triangles& triangles_;
  bool in_view_ = false;
  Points from_eye_m_;  ///< vertices
  Vec3 axis_, right_, down_;
  double left_ = 0, top_ = 0, cells_per_slope_ = 0;  ///< the plane is one away from the eye: its coordinates are slopes
  Index columns_ = 0, rows_ = 0;
  std::vector<Index> first_;  ///< of a cell among the entries, row after row; one more at the end
  std::vector<Index> entries_;  ///< triangles
  std::vector<float> nearest_;  ///< of a triangle along the axis: no point of it is nearer
};

}  // namespace palpate::geometry
