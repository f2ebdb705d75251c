// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/contact/surface_points.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::fem {
namespace {

// Shape functions of a face (corners, midpoints of 01, 12, 20) and their derivatives to l0, l1 at l2 = 1 - l0 - l1.
void face_shapes(int nodes, const Vec3& l, Eigen::Ref<VectorX> value, Eigen::Ref<MatrixX> slope) {
  Eigen::Matrix<double, 3, 2> d;
  d << 1, 0, 0, 1, -1, -1;
  if (nodes == 3) {
    value = l;
    slope = d;
    return;
  }
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    value(i) = l(i) * (2 * l(i) - 1);
    value(3 + i) = 4 * l(i) * l(j);
    slope.row(i) = (4 * l(i) - 1) * d.row(i);
    slope.row(3 + i) = 4 * (l(i) * d.row(j) + l(j) * d.row(i));
  }
}

}  // namespace

SurfacePoints::SurfacePoints(const TetMesh& mesh, const BlockPattern& pattern, int per_edge)
    : per_edge_(per_edge), faces_(boundary_faces(mesh, &elements_)) {
  if (per_edge < 1) throw Error("must be at least 1", "points_per_edge");
  const int nodes = static_cast<int>(faces_.cols());
  std::vector<Vec3> points;
  const double n = per_edge;
  const auto add = [&](double i, double j, double sign) {
    for (int k = 0; k < 3; ++k) {
      const double u = i + sign * (k == 1 ? 4.0 : 1.0) / 6, v = j + sign * (k == 2 ? 4.0 : 1.0) / 6;
      points.emplace_back(1 - (u + v) / n, u / n, v / n);
    }
  };
  for (int i = 0; i < per_edge; ++i)
    for (int j = 0; i + j < per_edge; ++j) {
      add(i, j, 1);
      if (i + j + 1 < per_edge) add(i + 1, j + 1, -1);
    }
  const auto count = static_cast<Index>(points.size());
  shapes_.resize(nodes, count);
  d_shapes_.resize(nodes, 2 * count);
  for (Index p = 0; p < count; ++p) {
    VectorX value(nodes);
    MatrixX slope(nodes, 2);
    face_shapes(nodes, points[p], value, slope);
    shapes_.col(p) = value;
    d_shapes_.middleCols(2 * p, 2) = slope;
  }
  weights_.reserve(static_cast<std::size_t>(face_count()) * count);
  size_m_.resize(face_count());
  blocks_.resize(static_cast<std::size_t>(face_count()) * nodes * nodes);
  for (Index f = 0; f < face_count(); ++f) {
    Eigen::Matrix<double, 3, Eigen::Dynamic> x(3, nodes);
    for (int a = 0; a < nodes; ++a) x.col(a) = mesh.nodes_m.row(faces_(f, a)).transpose();
    double area = 0;
    for (Index p = 0; p < count; ++p) {
      const Eigen::Matrix<double, 3, 2> t = x * d_shapes_.middleCols(2 * p, 2);
      weights_.push_back(0.5 * t.col(0).cross(t.col(1)).norm() / count);
      area += weights_.back();
    }
    size_m_[f] = std::sqrt(area);
    for (int a = 0; a < nodes; ++a)
      for (int b = 0; b < nodes; ++b) {
        const Index row = std::max(faces_(f, a), faces_(f, b)), column = std::min(faces_(f, a), faces_(f, b));
        const auto begin = pattern.row.begin() + pattern.column_start[column],
                   end = pattern.row.begin() + pattern.column_start[column + 1];
        blocks_[(static_cast<std::size_t>(f) * nodes + a) * nodes + b] =
            static_cast<Index>(std::lower_bound(begin, end, row) - pattern.row.begin());
      }
  }
}

}  // namespace palpate::fem
