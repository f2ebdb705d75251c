// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

struct Bvh;

struct ClosestPoint {
  Index triangle = -1;
  Vec3 barycentric = Vec3::Zero();  ///< sums to one; point = sum barycentric(k) * vertex(k)
  Vec3 point_m = Vec3::Zero();
  double squared_distance_m2 = 0;
};

struct RayHit {
  Index triangle = -1;
  Vec3 barycentric = Vec3::Zero();
  double range_m = 0;
};

/// Bounding volume hierarchy over the triangles of a surface; exact in double. Const queries are thread-safe.
class TriangleTree {
 public:
  /// @throws Error when there is no triangle, an index is out of range or a vertex is not finite.
  explicit TriangleTree(TriMesh mesh);
  /// Same triangles at the same place, at a fraction of what building the hierarchy takes.
  TriangleTree(const TriangleTree& other);
  ~TriangleTree();
  TriangleTree(TriangleTree&&) noexcept;
  TriangleTree& operator=(TriangleTree&&) noexcept;

  /// Same triangles, moved vertices: boxes are refitted, not rebuilt.
  /// @throws Error when the number of rows differs or a vertex is not finite; the tree is then as before.
  void refit(const Points& vertices_m);

  /// Closest point of the surface; of triangles that are equally near the one with the smallest number. `hint`: a triangle
  /// that is likely near (the last answer), or -1; it changes nothing but the speed. A point that is not finite gets
  /// triangle -1 and a squared distance of NaN.
  ClosestPoint closest(const Vec3& point_m, Index hint = -1) const;

  /// Is the surface within this distance? Several times as fast as closest() where it is.
  bool within(const Vec3& point_m, double squared_distance_m2, Index hint = -1) const;

  /// First hit of a ray, both sides of a triangle count. `direction` need not have unit length; range is in its units.
  /// No ray slips between two triangles that share an edge (Woop, Benthin, Wald 2013). `hint`: a triangle that is likely
  /// hit, or -1; between triangles that are hit at the same range it may change which one is named.
  std::optional<RayHit> cast(const Vec3& origin_m, const Vec3& direction, double max_range = 1e300, Index hint = -1) const;

  /// Number of triangles that the endless ray meets (a crossing of an edge counts for both of its triangles).
  int crossings(const Vec3& origin_m, const Vec3& direction) const;

  const TriMesh& mesh() const;
  const Bvh& bvh() const;  ///< for others that walk the same triangles

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::geometry
