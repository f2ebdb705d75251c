// SPDX-License-Identifier: Apache-2.0
// Stiffness-like matrices for tests of the linear algebra: a lattice of nodes with three unknowns each, joined by random
// springs of full 3 x 3 blocks; made without the finite elements so that neither can hide the other's faults.
#pragma once

#include <Eigen/SparseCore>
#include <random>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::test {

/// Lower triangle of a positive definite matrix on nx x ny x nz nodes with neighbours in the 27-point stencil.
/// @param diagonal_shift  added to the diagonal (negative: makes it indefinite); the smallest eigenvalue is near 0.05
/// @param drop  unknowns to leave out (held by a support), as indices of the full matrix
inline Eigen::SparseMatrix<double> lattice_matrix(int nx, int ny, int nz, double diagonal_shift = 0.0, unsigned seed = 1,
                                                  const std::vector<Index>& drop = {}) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto node = [&](int x, int y, int z) { return (z * ny + y) * nx + x; };
  const Index size = 3 * nx * ny * nz;
  std::vector<Index> kept(static_cast<std::size_t>(size), 0);
  for (const Index unknown : drop) kept[static_cast<std::size_t>(unknown)] = -1;
  Index count = 0;
  for (Index& unknown : kept) unknown = unknown < 0 ? -1 : count++;
  std::vector<Eigen::Triplet<double>> entries;
  const auto add = [&](int a, int b, const Mat3& block) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const Index r = kept[static_cast<std::size_t>(3 * a + i)], c = kept[static_cast<std::size_t>(3 * b + j)];
        if (r >= c && c >= 0) entries.emplace_back(r, c, block(i, j));
      }
    }
  };
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        const int a = node(x, y, z);
        add(a, a, (0.05 + diagonal_shift) * Mat3::Identity());
        for (int dz = -1; dz <= 1; ++dz) {
          for (int dy = -1; dy <= 1; ++dy) {
            for (int dx = -1; dx <= 1; ++dx) {
              const int X = x + dx, Y = y + dy, Z = z + dz;
              if (X < 0 || Y < 0 || Z < 0 || X >= nx || Y >= ny || Z >= nz || node(X, Y, Z) <= a) continue;
              const int b = node(X, Y, Z);
              const Mat3 half = Mat3::NullaryExpr([&](Eigen::Index, Eigen::Index) { return uniform(generator); });
              const Mat3 stiffness = half * half.transpose();
              add(a, a, stiffness);
              add(b, b, stiffness);
              add(a, b, -stiffness);
              add(b, a, -stiffness);
            }
          }
        }
      }
    }
  }
  Eigen::SparseMatrix<double> lower(count, count);
  lower.setFromTriplets(entries.begin(), entries.end());
  return lower;
}

inline MatrixX dense_of(const Eigen::SparseMatrix<double>& lower) {
  return MatrixX(MatrixX(lower).selfadjointView<Eigen::Lower>());
}

inline MatrixX random_matrix(Eigen::Index rows, Eigen::Index columns, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  return MatrixX::NullaryExpr(rows, columns, [&](Eigen::Index, Eigen::Index) { return normal(generator); });
}

}  // namespace palpate::test
