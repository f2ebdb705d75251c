// SPDX-License-Identifier: Apache-2.0
// Meshes and finite differences that the tests of this room share.
#pragma once

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::fem {

/// nx x ny x nz cells of 5 tetrahedra each (alternating parity), from the origin to `size_m`.
inline TetMesh block_mesh(int nx, int ny, int nz, const Vec3& size_m, int parity = 0) {
  TetMesh mesh;
  const auto id = [&](int i, int j, int k) { return (k * (ny + 1) + j) * (nx + 1) + i; };
  mesh.nodes_m.resize((nx + 1) * (ny + 1) * (nz + 1), 3);
  for (int k = 0; k <= nz; ++k)
    for (int j = 0; j <= ny; ++j)
      for (int i = 0; i <= nx; ++i)
        mesh.nodes_m.row(id(i, j, k)) << size_m.x() * i / nx, size_m.y() * j / ny, size_m.z() * k / nz;
  mesh.tetrahedra.resize(5 * nx * ny * nz, 4);
  static const int even[5][4] = {{0, 1, 3, 5}, {0, 3, 2, 6}, {0, 5, 6, 4}, {3, 6, 5, 7}, {0, 3, 6, 5}};
  static const int odd[5][4] = {{1, 0, 4, 2}, {1, 2, 7, 3}, {1, 7, 4, 5}, {2, 4, 7, 6}, {1, 4, 7, 2}};
  Index row = 0;
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) {
        const Index corner[8] = {id(i, j, k),     id(i + 1, j, k),     id(i, j + 1, k),     id(i + 1, j + 1, k),
                                 id(i, j, k + 1), id(i + 1, j, k + 1), id(i, j + 1, k + 1), id(i + 1, j + 1, k + 1)};
        for (const auto& t : (i + j + k + parity) % 2 == 0 ? even : odd) {
          Index node[4] = {corner[t[0]], corner[t[1]], corner[t[2]], corner[t[3]]};
          Mat3 edges;
          for (int a = 0; a < 3; ++a) edges.col(a) = (mesh.nodes_m.row(node[a + 1]) - mesh.nodes_m.row(node[0])).transpose();
          if (edges.determinant() < 0) std::swap(node[2], node[3]);
          for (int a = 0; a < 4; ++a) mesh.tetrahedra(row, a) = node[a];
          ++row;
        }
      }
  return mesh;
}

/// Moves the nodes strictly inside the bounding box by up to `share` of a cell.
inline TetMesh distorted(TetMesh mesh, double amount_m, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-amount_m, amount_m);
  const Vec3 low = mesh.nodes_m.colwise().minCoeff().transpose(), high = mesh.nodes_m.colwise().maxCoeff().transpose();
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    const Vec3 x = mesh.nodes_m.row(i).transpose();
    if (((x - low).array() > 1e-9).all() && ((high - x).array() > 1e-9).all())
      for (int k = 0; k < 3; ++k) mesh.nodes_m(i, k) += uniform(random);
  }
  return mesh;
}

inline Vec3 node_position(const TetMesh& mesh, Index i) { return mesh.nodes_m.row(i).transpose(); }

template <typename Predicate>
std::vector<Index> nodes_where(const TetMesh& mesh, Predicate&& predicate) {
  std::vector<Index> nodes;
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i)
    if (predicate(node_position(mesh, i))) nodes.push_back(i);
  return nodes;
}

inline std::vector<Constraint> clamp(const std::vector<Index>& nodes) {
  std::vector<Constraint> constraints;
  for (Index i : nodes) constraints.push_back({i, Mat3::Identity(), 3});
  return constraints;
}

inline Index nearest_node(const TetMesh& mesh, const Vec3& x) {
  Index best = 0;
  (mesh.nodes_m.rowwise() - x.transpose()).rowwise().squaredNorm().minCoeff(&best);
  return best;
}

/// Columns side by side.
inline Eigen::SparseMatrix<double> hstack(const std::vector<Eigen::SparseMatrix<double>>& parts) {
  std::vector<Eigen::Triplet<double>> triplets;
  Index columns = 0, rows = 0;
  for (const auto& part : parts) {
    rows = static_cast<Index>(part.rows());
    for (Index k = 0; k < part.outerSize(); ++k)
      for (Eigen::SparseMatrix<double>::InnerIterator it(part, k); it; ++it)
        triplets.emplace_back(it.row(), columns + k, it.value());
    columns += static_cast<Index>(part.cols());
  }
  Eigen::SparseMatrix<double> out(rows, columns);
  out.setFromTriplets(triplets.begin(), triplets.end());
  return out;
}

}  // namespace palpate::fem
