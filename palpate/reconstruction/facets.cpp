// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/facets.hpp"

#include <algorithm>

namespace palpate::reconstruction {

bool settle(Facet& f, const Grid& grid, double cell) {
  const auto [u, v] = tangents(f.normal);
  Eigen::Matrix<double, 6, 6> a = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
  int count = 0;
  double squares = 0, weights = 0;
  grid.around(f.middle, 1, [&](Index i) {
    if (grid.normal(i).dot(f.normal) < 0.5) return;
    const Vec3 d = (grid.point(i) - f.middle) / cell;
    const double x = u.dot(d), y = v.dot(d), r2 = x * x + y * y;
    if (r2 > 2.25) return;
    const double w = (1 - r2 / 2.25) * (1 - r2 / 2.25);
    Eigen::Matrix<double, 6, 1> row;
    row << 1, x, y, x * x, x * y, y * y;
    a += w * row * row.transpose();
    const double z = f.normal.dot(d);
    b += w * z * row;
    squares += w * z * z, weights += w;
    ++count;
  });
  if (count < 3) return false;
  const int terms = count >= 18 ? 6 : 1;  // fewer points do not carry a curvature
  a.diagonal().array() += 1e-6 * a(0, 0);
  Eigen::Matrix<double, 6, 1> s = Eigen::Matrix<double, 6, 1>::Zero();
  const Eigen::LDLT<MatrixX> factor(a.topLeftCorner(terms, terms));
  s.head(terms) = factor.solve(b.head(terms));
  // scatter of the points about the fit, and what is left of it at the middle
  const double scatter2 = std::max(0.0, squares - s.dot(b)) / weights * count / std::max(1, count - terms);
  f.sigma_m = cell * std::sqrt(scatter2 * factor.solve(VectorX::Unit(terms, 0))[0]);
  f.middle += std::clamp(s[0], -1.0, 1.0) * cell * f.normal;
  f.normal = (f.normal - std::clamp(s[1], -1.0, 1.0) * u - std::clamp(s[2], -1.0, 1.0) * v).normalized();
  return true;
}

void share_out_area(std::vector<Facet>& facets, double cell) {
  PointCloud middles;
  middles.points_m.resize(static_cast<Index>(facets.size()), 3);
  middles.normals.resize(static_cast<Index>(facets.size()), 3);
  for (std::size_t i = 0; i < facets.size(); ++i) {
    middles.points_m.row(i) = facets[i].middle.transpose();
    middles.normals.row(i) = facets[i].normal.transpose();
  }
  const double radius = 2 * cell;
  const Grid grid({middles}, radius);
  for (Facet& f : facets) {
    int count = 0;
    grid.around(f.middle, 1, [&](Index i) {
      count += (grid.point(i) - f.middle).squaredNorm() < radius * radius && grid.normal(i).dot(f.normal) > 0.3;
    });
    f.area_m2 = M_PI * radius * radius / std::max(1, count);
  }
}

TriMesh triangles_of(const std::vector<Facet>& facets) {
  TriMesh out;
  out.vertices_m.resize(3 * static_cast<Index>(facets.size()), 3);
  out.triangles.resize(static_cast<Index>(facets.size()), 3);
  for (Index i = 0; i < static_cast<Index>(facets.size()); ++i) {
    const Facet& f = facets[i];
    const auto [u, v] = tangents(f.normal);
    const double radius = std::sqrt(f.area_m2 / (0.75 * std::sqrt(3.0)));
    for (int k = 0; k < 3; ++k) {
      const double angle = 2 * M_PI * k / 3 + 1.7 * i;
      out.vertices_m.row(3 * i + k) = (f.middle + radius * (std::cos(angle) * u + std::sin(angle) * v)).transpose();
    }
    out.triangles.row(i) << 3 * i, 3 * i + 1, 3 * i + 2;
  }
  return out;
}

Vec3 middle_of(const TriMesh& facets, Index t) {
  const auto corner = [&](int k) { return facets.vertices_m.row(facets.triangles(t, k)); };
  return (corner(0) + corner(1) + corner(2)).transpose() / 3;
}

Vec3 area_of(const TriMesh& facets, Index t) {
  const auto corner = [&](int k) { return Vec3(facets.vertices_m.row(facets.triangles(t, k))); };
  return 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0));
}

}  // namespace palpate::reconstruction
