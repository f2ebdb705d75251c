// SPDX-License-Identifier: Apache-2.0
// The cube that all timings of the linear algebra use: edge 0.15 m, n^3 cells of five linear tetrahedra with alternating
// parity, bottom held, pressed down by a uniform pressure on a disc of 25 mm radius at the centre of the top (10 N in all).
#pragma once

#include <Eigen/LU>
#include <Eigen/SparseCore>
#include <array>
#include <cmath>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/fem/linear_solver.hpp"

namespace palpate::benchmark_cube {

constexpr double kEdge = 0.15, kDiscRadius = 0.025, kForce = 10.0, kYoung = 20e3;

inline TetMesh mesh(int n) {
  TetMesh result;
  const int m = n + 1;
  result.nodes_m.resize(m * m * m, 3);
  const auto node = [&](int x, int y, int z) { return (z * m + y) * m + x; };
  for (int z = 0; z < m; ++z) {
    for (int y = 0; y < m; ++y) {
      for (int x = 0; x < m; ++x) result.nodes_m.row(node(x, y, z)) << x * kEdge / n, y * kEdge / n, z * kEdge / n;
    }
  }
  result.tetrahedra.resize(5 * n * n * n, 4);
  // Corners of a cell are bits xyz; the second pattern is the first one mirrored in x.
  constexpr int kPattern[5][4] = {{0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}, {1, 2, 4, 7}};
  int row = 0;
  for (int z = 0; z < n; ++z) {
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        const int mirror = (x + y + z) % 2;
        for (const auto& tet : kPattern) {
          std::array<int, 4> corner{};
          for (int i = 0; i < 4; ++i) {
            const int bits = tet[i] ^ mirror;
            corner[static_cast<std::size_t>(i)] = node(x + (bits & 1), y + (bits >> 1 & 1), z + (bits >> 2 & 1));
          }
          Mat3 edges;
          for (int i = 0; i < 3; ++i) {
            edges.col(i) =
                (result.nodes_m.row(corner[static_cast<std::size_t>(i) + 1]) - result.nodes_m.row(corner[0])).transpose();
          }
          if (edges.determinant() < 0) std::swap(corner[2], corner[3]);
          result.tetrahedra.row(row++) << corner[0], corner[1], corner[2], corner[3];
        }
      }
    }
  }
  return result;
}

/// Stiffness of the free unknowns, lower triangle. Nodes of the bottom come first, so unknown u belongs to node
/// u / 3 + (n + 1)^2.
inline Eigen::SparseMatrix<double> stiffness(const TetMesh& mesh, int n, double poisson_ratio) {
  const int held = (n + 1) * (n + 1), free = static_cast<int>(mesh.nodes_m.rows()) - held;
  const double lambda = kYoung * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio));
  const double mu = kYoung / (2 * (1 + poisson_ratio));
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<std::size_t>(mesh.tetrahedra.rows()) * 78);
  for (Eigen::Index t = 0; t < mesh.tetrahedra.rows(); ++t) {
    Mat3 edges;
    for (int i = 0; i < 3; ++i) {
      edges.col(i) = (mesh.nodes_m.row(mesh.tetrahedra(t, i + 1)) - mesh.nodes_m.row(mesh.tetrahedra(t, 0))).transpose();
    }
    const double volume = edges.determinant() / 6;
    Eigen::Matrix<double, 3, 4> gradient;
    gradient.rightCols<3>() = edges.inverse().transpose();
    gradient.col(0) = -gradient.rightCols<3>().rowwise().sum();
    for (int a = 0; a < 4; ++a) {
      for (int b = 0; b < 4; ++b) {
        const int row = mesh.tetrahedra(t, a) - held, column = mesh.tetrahedra(t, b) - held;
        if (row < column || column < 0) continue;
        const Vec3 g = gradient.col(a), h = gradient.col(b);
        const Mat3 block = volume * (lambda * g * h.transpose() + mu * h * g.transpose() + mu * g.dot(h) * Mat3::Identity());
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) {
            if (row > column || i >= j) entries.emplace_back(3 * row + i, 3 * column + j, block(i, j));
          }
        }
      }
    }
  }
  Eigen::SparseMatrix<double> lower(3 * free, 3 * free);
  lower.setFromTriplets(entries.begin(), entries.end());
  return lower;
}

/// Where the free unknowns act.
inline fem::UnknownPlacement placement(const TetMesh& mesh, int n) {
  const int held = (n + 1) * (n + 1);
  const Eigen::Index size = 3 * (mesh.nodes_m.rows() - held);
  fem::UnknownPlacement result{Points(size, 3), Points::Zero(size, 3)};
  for (Eigen::Index u = 0; u < size; ++u) {
    result.point_m.row(u) = mesh.nodes_m.row(u / 3 + held);
    result.direction(u, u % 3) = 1;
  }
  return result;
}

/// Consistent forces of the disc's pressure, by sampling every top triangle finely.
inline VectorX disc_load(const TetMesh& mesh, int n) {
  constexpr int kSamples = 24;
  const int held = (n + 1) * (n + 1);
  VectorX load = VectorX::Zero(3 * (mesh.nodes_m.rows() - held));
  double total = 0;
  constexpr int kFaces[4][3] = {{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}};
  for (Eigen::Index t = 0; t < mesh.tetrahedra.rows(); ++t) {
    for (const auto& face : kFaces) {
      Mat3 corners;
      for (int i = 0; i < 3; ++i) corners.col(i) = mesh.nodes_m.row(mesh.tetrahedra(t, face[i])).transpose();
      if (corners.row(2).minCoeff() < kEdge * (1 - 1e-9)) continue;
      for (int i = 0; i < kSamples; ++i) {
        for (int j = 0; j < kSamples - i; ++j) {
          for (int half = 0; half < (j < kSamples - i - 1 ? 2 : 1); ++half) {
            const double shift = half == 0 ? 1.0 / 3 : 2.0 / 3;
            const Vec3 weight((i + shift) / kSamples, (j + shift) / kSamples, 1 - (i + j + 2 * shift) / kSamples);
            const Vec3 point = corners * weight;
            if (std::hypot(point.x() - kEdge / 2, point.y() - kEdge / 2) > kDiscRadius) continue;
            for (int c = 0; c < 3; ++c) load(3 * (mesh.tetrahedra(t, face[c]) - held) + 2) -= weight(c);
            total += 1;
          }
        }
      }
    }
  }
  return load * (kForce / total);
}

}  // namespace palpate::benchmark_cube
