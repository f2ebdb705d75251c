// SPDX-License-Identifier: Apache-2.0
// Inside of TriangleTree: closest points. The hierarchy is packed so tightly that a mesh of 70 000 triangles stays within a
// core's second cache: eight children a node with boxes of one byte a side (Ylitie, Karras, Laine 2017), four triangles a
// block with corners of 16 bits. These bound distances from below and above; what may be nearest is then asked in double.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "palpate/geometry/bvh.hpp"
#include "palpate/geometry/closest_on_triangle.hpp"

namespace palpate::geometry {

class ClosestSearch {
 public:
  /// @param bvh  of the mesh's triangles, at most four a leaf
  ClosestSearch(const TriMesh& mesh, const Bvh& bvh);

  /// Same triangles, moved vertices. @param bvh  the same hierarchy, refitted
  void refit(const TriMesh& mesh, const Bvh& bvh);

  struct Found {
    Index triangle = -1;  ///< of those that are equally near the one with the smallest number
    Candidate at{std::numeric_limits<double>::infinity(), 0, 0};
    Vec3 point_m = Vec3::Zero();
  };
  /// @param hint  a triangle, or -1
  Found closest(const Vec3& point_m, Index hint) const;
  bool within(const Vec3& point_m, double squared_distance_m2, Index hint) const;

 private:
  static constexpr int width = 8, block_size = 4;
  /// Boxes are origin + step * byte, rounded outwards, relative to `centre_m_`.
  struct alignas(64) Node {
    std::array<std::array<std::uint8_t, width>, 3> low{}, high{};
    std::array<float, 3> origin{}, step{};
    std::array<std::int32_t, width> child{};  ///< a node, or the complement of (block << 6 | thin << 2 | triangles - 1)
    std::uint32_t valid = 0;                  ///< bit a child
  };
  /// Corners on the grid of `low_m_` and `unit_m_`: corner, axis, triangle; the last triangle is repeated in empty places.
  struct Block {
    std::array<std::array<std::array<std::uint16_t, block_size>, 3>, 3> corner{};
  };
  struct Query;
  struct Builder;

  void place(const TriMesh& mesh, const Bvh& bvh);
  std::uint32_t fill(Index block, int count, const TriMesh& mesh);

  std::vector<Node> nodes_;
  std::vector<Block> blocks_;
  std::vector<std::array<Index, width>> source_;  ///< of a child: 2 node + side in the binary hierarchy
  std::vector<Corner> exact_;                     ///< four a block
  std::vector<Index> triangle_;                   ///< of them; -1 where a block has fewer
  std::vector<Index> slot_;                       ///< of a triangle in `exact_`
  Vec3 centre_m_ = Vec3::Zero(), low_m_ = Vec3::Zero();
  double extent_m_ = 0, unit_m_ = 0;
};

}  // namespace palpate::geometry
