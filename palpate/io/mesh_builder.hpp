// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "palpate/io/mesh_file.hpp"

namespace palpate::io {

/// Collects points and cells of unknown number while a file is read. Cells are checked against the points at the end, by
/// parse_mesh.
class MeshBuilder {
 public:
  void reserve_points(std::size_t count) { coordinates_.reserve(3 * count); }
  void point(double x, double y, double z) { coordinates_.insert(coordinates_.end(), {x, y, z}); }
  std::size_t points() const { return coordinates_.size() / 3; }
  void triangle(Index a, Index b, Index c) { triangles_.insert(triangles_.end(), {a, b, c}); }
  void polygon(const std::vector<Index>& corners);  ///< as a fan of triangles
  void tetrahedron(const Index* nodes, int count);  ///< 4 or 10, VTK order
  std::size_t cells() const { return triangles_.size() + tets4_.size() + tets10_.size(); }

  /// Takes what was collected. Throws Error when linear and quadratic tetrahedra are mixed.
  MeshData build(const std::string& name);

 private:
  std::vector<double> coordinates_;
  std::vector<Index> triangles_, tets4_, tets10_;
};

}  // namespace palpate::io
