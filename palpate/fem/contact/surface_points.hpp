// SPDX-License-Identifier: Apache-2.0
// Quadrature points on the boundary faces of a tetrahedral mesh: where contact is looked for. Nodes alone would miss a tool
// between them, and on quadratic faces the corners carry no share of a uniform pressure.
#pragma once

#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/fem/assembly.hpp"

namespace palpate::fem {

class SurfacePoints {
 public:
  /// Every face is cut into per_edge^2 triangles of three points each.
  SurfacePoints(const TetMesh& mesh, const BlockPattern& pattern, int per_edge);

  Index face_count() const { return static_cast<Index>(faces_.rows()); }
  int per_face() const { return static_cast<int>(shapes_.cols()); }
  int nodes_per_face() const { return static_cast<int>(faces_.cols()); }
  Index point_count() const { return face_count() * per_face(); }

  Index element(Index face) const { return elements_[static_cast<std::size_t>(face)]; }  ///< that it bounds
  Index node(Index face, int a) const { return faces_(face, a); }
  /// Lower block of two nodes of a face; stored transposed when node a has the smaller number.
  Index block(Index face, int a, int b) const {
    return blocks_[(static_cast<std::size_t>(face) * faces_.cols() + a) * faces_.cols() + b];
  }
  auto shape(int point) const { return shapes_.col(point); }                    ///< values at a point of every face
  auto d_shape(int point) const { return d_shapes_.middleCols<2>(2 * point); }  ///< to the first two barycentric coordinates
  double weight_m2(Index face, int point) const { return weights_[static_cast<std::size_t>(face) * per_face() + point]; }
  double face_size_m(Index face) const { return size_m_[face]; }  ///< square root of its area
  double cell_m(Index face) const { return size_m_[face] / per_edge_; }

 private:
  int per_edge_;
  std::vector<Index> elements_;
  Tetrahedra faces_;
  std::vector<Index> blocks_;
  Eigen::MatrixXd shapes_, d_shapes_;
  std::vector<double> weights_, size_m_;
};

}  // namespace palpate::fem
