// SPDX-License-Identifier: Apache-2.0
// The surface that sensors see, as weights on the nodes of the simulated mesh.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::estimation {

/// Each surface vertex is a weighted sum of a few nodes (itself only, where the surface is the mesh's own boundary).
class SimulatedSurface {
 public:
  /// The boundary of `mesh` (quadratic faces split in four); `observed` (corner triples) marks the part that sensors see.
  static SimulatedSurface boundary_of(const TetMesh& mesh, const Triangles* observed);
  /// A surface embedded in `mesh`: it stays where it is at rest and moves by the element's shape functions (linear or quadratic)
  /// at its barycentric weights, so a mesh that rounds an edge off does not round the surface.
  static SimulatedSurface embedded(const TetMesh& mesh, const TriMesh& surface, const SurfaceEmbedding& embedding);

  const TriMesh& rest() const { return rest_; }
  /// True where sensors see the triangle (all true when nothing was said).
  const std::vector<char>& observed() const { return observed_; }

  /// Values at the surface vertices (rows) of a nodal vector field given as 3n x m (node-major): 3v x m.
  MatrixX restrict(const MatrixX& nodal) const;
  /// The same as a matrix, 3v x 3 node_count.
  Eigen::SparseMatrix<double> rows(Index node_count) const;
  Index vertex_count() const { return static_cast<Index>(rest_.vertices_m.rows()); }

 private:
  TriMesh rest_;
  std::vector<char> observed_;
  std::vector<int> start_;       // of each vertex in nodes_/weights_
  std::vector<Index> nodes_;
  std::vector<double> weights_;
};

}  // namespace palpate::estimation
