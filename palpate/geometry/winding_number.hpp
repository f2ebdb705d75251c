// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
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
  WindingNumber(const TriMesh& mesh, const Bvh& bvh);
  double operator()(const Vec3& point_m) const;
  /// Without one triangle: on that triangle the mean of its two sides.
  double without(const Vec3& point_m, Index triangle) const;

 private:
  /// What a subtree amounts to from afar.
  struct Dipole {
    Vec3 centre = Vec3::Zero(), area = Vec3::Zero();  ///< area: sum of normals times areas
    double near2 = 0;                                 ///< squared distance up to which its parts are asked instead
  };
  /// All that a query asks of a node in two lines of the cache. `child`, `count`: as in BvhNode.
  struct alignas(64) Node {
    std::array<Dipole, 2> dipole;
    std::array<Index, 2> child{-1, -1}, count{0, 0};
  };
  double sum(const Vec3& p, Index skip) const;
  std::vector<Node> nodes_;
  std::vector<std::array<Vec3, 3>> corners_;  ///< of the triangles, leaf after leaf
  std::vector<Index> slot_;                   ///< of a triangle in `corners_`
};

}  // namespace palpate::geometry
