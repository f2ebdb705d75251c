// SPDX-License-Identifier: Apache-2.0
// Shape functions and quadrature of linear and quadratic tetrahedra (VTK node order).
#pragma once

#include <Eigen/LU>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::fem {

/// Edges in the order of the midpoint nodes 4..9.
inline constexpr int kTetEdges[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};
/// Faces, counter-clockwise seen from outside.
inline constexpr int kTetFaces[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
/// Midpoint node (4..9) of the edge between two corners.
inline int edge_node(int a, int b) {
  for (int e = 0; e < 6; ++e)
    if ((kTetEdges[e][0] == a && kTetEdges[e][1] == b) || (kTetEdges[e][0] == b && kTetEdges[e][1] == a)) return 4 + e;
  return -1;
}

struct TetQuadraturePoint {
  Eigen::Vector4d barycentric;
  double weight;  ///< of the reference volume 1/6: weights sum to 1/6
};

/// One point (exact to degree 1).
inline std::vector<TetQuadraturePoint> tet_quadrature_1() { return {{Eigen::Vector4d::Constant(0.25), 1.0 / 6}}; }

/// Four points (exact to degree 2; what CalculiX' C3D10 uses).
inline std::vector<TetQuadraturePoint> tet_quadrature_4() {
  const double a = 0.58541019662496845446, b = 0.13819660112501051518;
  std::vector<TetQuadraturePoint> points;
  for (int i = 0; i < 4; ++i) {
    Eigen::Vector4d l = Eigen::Vector4d::Constant(b);
    l(i) = a;
    points.push_back({l, 1.0 / 24});
  }
  return points;
}

/// 64 points: Gauss-Legendre collapsed to the tetrahedron, exact to degree 5 (the Jacobian takes two of the seven); for
/// one-time integrals of mass and body force.
inline std::vector<TetQuadraturePoint> tet_quadrature_64() {
  const double x[4] = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629};
  const double w[4] = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693};
  std::vector<TetQuadraturePoint> points;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < 4; ++k) {
        const double a = x[i], b = x[j] * (1 - a), c = x[k] * (1 - a - b);
        points.push_back({{1 - a - b - c, a, b, c}, w[i] * w[j] * w[k] * (1 - a) * (1 - a - b)});
      }
  return points;
}

/// Values of the 4 or 10 shape functions.
inline VectorX tet_shape(int nodes, const Eigen::Vector4d& l) {
  if (nodes == 4) return l;
  VectorX n(10);
  for (int i = 0; i < 4; ++i) n(i) = l(i) * (2 * l(i) - 1);
  for (int e = 0; e < 6; ++e) n(4 + e) = 4 * l(kTetEdges[e][0]) * l(kTetEdges[e][1]);
  return n;
}

/// Derivatives of the shape functions to the reference coordinates (l1, l2, l3), l0 = 1 - l1 - l2 - l3: nodes x 3.
inline Eigen::Matrix<double, Eigen::Dynamic, 3> tet_shape_gradient(int nodes, const Eigen::Vector4d& l) {
  Eigen::Matrix<double, 4, 3> d;
  d << -1, -1, -1, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  if (nodes == 4) return d;
  Eigen::Matrix<double, Eigen::Dynamic, 3> g(10, 3);
  for (int i = 0; i < 4; ++i) g.row(i) = (4 * l(i) - 1) * d.row(i);
  for (int e = 0; e < 6; ++e) {
    const int a = kTetEdges[e][0], b = kTetEdges[e][1];
    g.row(4 + e) = 4 * (l(a) * d.row(b) + l(b) * d.row(a));
  }
  return g;
}

}  // namespace palpate::fem
