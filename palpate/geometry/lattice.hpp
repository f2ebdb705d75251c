// SPDX-License-Identifier: Apache-2.0
// Inside of tetrahedralise: a body-centred cubic lattice of tetrahedra around a solid, bisected where the solid needs it.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <unordered_map>
#include <vector>

#include "palpate/geometry/solid.hpp"

namespace palpate::geometry {

/// Points of a solid's surface with outward normals; hidden ones are left out.
struct SurfaceSamples {
  std::vector<Vec3> point, normal;
  std::size_t evenly = 0;  ///< that many are spread by area, the rest lies in the middle of triangles
  double area_each_m2 = 0;
  double buried_m3 = 0;  ///< what hidden parts, and copies of visible ones, add to the solid's signed volume
};
SurfaceSamples sample_surface(const Solid& solid, int count);

/// Longest-edge bisection of the lattice's congruent tetrahedra only makes three further shapes (Sommerville), dihedral
/// angles of 45 to 120 degrees, and stays conforming because the longest edge is unique.
class Lattice {
 public:
  using Tet = std::array<Index, 4>;

  /// Lattice of `cell_m` (edge of a cube; the tetrahedra have edges of 0.87 and 1 of it) wherever the solid may be.
  Lattice(const Solid& solid, double cell_m);

  /// Bisects every tetrahedron in which the linear interpolation of the signed distance misses a surface sample by more than
  /// `tolerance_m`, down to edges of `smallest_edge_m`. False when that takes more than `most` tetrahedra.
  bool refine_to_surface(const SurfaceSamples& samples, double tolerance_m, double smallest_edge_m, std::size_t most);

  /// Bisects until no tetrahedron's longest edge exceeds `longest_edge_m` of its middle.
  void refine_to_size(const std::function<double(const Vec3&)>& longest_edge_m);

  const std::vector<Vec3>& points() const { return points_; }
  const std::vector<double>& distances() const { return distances_; }  ///< signed, negative inside
  std::vector<Tet> tetrahedra() const;

 private:
  using Key = std::uint64_t;
  using Cell = std::array<std::int64_t, 3>;
  Index vertex_at(const Cell& at);
  Index add_tet(const Tet& t);
  std::pair<int, int> longest_edge(const Tet& t) const;
  std::int64_t edge2(Index a, Index b) const;
  void bisect(Index tet);
  void split(Index a, Index b, const std::vector<Index>& around);
  bool misses(Index tet) const;

  const Solid& solid_;
  double unit_m_;
  Vec3 origin_;
  std::unordered_map<Key, Index> index_;
  std::vector<Cell> cells_;
  std::vector<Vec3> points_;
  std::vector<double> distances_;
  std::vector<Tet> tets_;
  std::vector<char> alive_;
  std::vector<std::vector<Index>> around_;   ///< vertex -> tetrahedra (alive)
  std::vector<std::vector<Index>> samples_;  ///< of a tetrahedron
  const SurfaceSamples* sample_set_ = nullptr;
  double tolerance_m_ = 0;
};

}  // namespace palpate::geometry
