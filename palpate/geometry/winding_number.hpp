// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/geometry/bvh.hpp"

namespace palpate::geometry {

/// Generalised winding number (Jacobson, Kavan, Sorkine-Hornung 2013): how often a triangle soup surrounds a point. 1 inside
/// and 0 outside a closed surface, harmonic in between where it has holes. Far triangles are summed as one dipole (Barill et
/// al. 2018, first order), near ones exactly.
class WindingNumber {
 public:
  explicit WindingNumber(const TriMesh& mesh);
  /// `bvh`: over the mesh's triangles.
  WindingNumber(const TriMesh& mesh, Bvh bvh);
  double operator()(const Vec3& point_m) const;
  /// Without one triangle: on that triangle the mean of its two sides.
  double without(const Vec3& point_m, Index triangle) const;

 private:
  struct Dipole {
    Vec3 centre = Vec3::Zero(), area = Vec3::Zero();  ///< area: sum of normals times areas
    double radius = 0;
  };
  double sum(const Vec3& p, Index skip) const;
  Points vertices_;
  Triangles triangles_;
  Bvh bvh_;
  std::vector<Dipole> dipoles_;  ///< two a node
};

}  // namespace palpate::geometry
