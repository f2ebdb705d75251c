// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/surface_field.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"

namespace palpate::estimation {
namespace {

constexpr Index most_carriers = 400;
constexpr double kept = 0.995;     // of the field's variance: the normal equations cost the square of the modes a point
constexpr double carrier_spacing = 0.65;   // of the points that carry the field, in correlation lengths

Points vertex_normals(const TriMesh& mesh) {
  Points normals = Points::Zero(mesh.vertices_m.rows(), 3);
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(mesh.vertices_m.row(mesh.triangles(t, k))); };
    const Vec3 area = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    for (int k = 0; k < 3; ++k) normals.row(mesh.triangles(t, k)) += area.transpose();
  }
  for (Index v = 0; v < normals.rows(); ++v) {
    const double length = normals.row(v).norm();
    if (length > 0) normals.row(v) /= length;
  }
  return normals;
}

}  // namespace

SurfaceField::SurfaceField(const TriMesh& rest, double std_m, double correlation_m) : std_m_(std_m) {
  if (!(std_m > 0) || !(correlation_m > 0)) {
    throw Error("surface_std_m and surface_correlation_m must be positive lengths in metres", "rest");
  }
  const Index count = static_cast<Index>(rest.vertices_m.rows());
  if (count == 0) throw Error("the surface is empty", "rest");
  normals_ = vertex_normals(rest);
  const auto covariance = [&](Index a, Index b) {
    const double apart2 = (rest.vertices_m.row(a) - rest.vertices_m.row(b)).squaredNorm();
    return std_m * std_m * normals_.row(a).dot(normals_.row(b)) * std::exp(-0.5 * apart2 / (correlation_m * correlation_m));
  };

  // Farthest points first, in place and direction: two sides of an edge err apart.
  std::vector<Index> carriers{0};
  VectorX gap2 = VectorX::Constant(count, std::numeric_limits<double>::infinity());
  const double enough2 = std::pow(carrier_spacing * correlation_m, 2);
  while (static_cast<Index>(carriers.size()) < most_carriers) {
    const Index last = carriers.back();
    for (Index v = 0; v < count; ++v) {
      const double d2 = (rest.vertices_m.row(v) - rest.vertices_m.row(last)).squaredNorm() +
                        correlation_m * correlation_m * (normals_.row(v) - normals_.row(last)).squaredNorm();
      gap2(v) = std::min(gap2(v), d2);
    }
    Index farthest = 0;
    if (gap2.maxCoeff(&farthest) < enough2) break;
    carriers.push_back(farthest);
  }
  const Index modes = static_cast<Index>(carriers.size());
  MatrixX among(modes, modes), across(count, modes);
  for (Index m = 0; m < modes; ++m) {
    const Index carrier = carriers[static_cast<std::size_t>(m)];
    for (Index k = 0; k < modes; ++k) among(k, m) = covariance(carriers[static_cast<std::size_t>(k)], carrier);
    for (Index v = 0; v < count; ++v) across(v, m) = covariance(v, carrier);
  }
  among.diagonal().array() += 1e-8 * std_m * std_m;
  const Eigen::LLT<MatrixX> root(among);
  // A smooth field has few directions that matter: the principal ones over the vertices, until little is left. There are many
  // vertices: what is done to each of them is done last, for what is kept.
  MatrixX over_vertices = MatrixX::Zero(modes, modes);
  over_vertices.selfadjointView<Eigen::Lower>().rankUpdate(across.transpose());
  over_vertices.triangularView<Eigen::StrictlyUpper>() = over_vertices.transpose();
  root.matrixL().solveInPlace(over_vertices);
  root.matrixU().solveInPlace<Eigen::OnTheRight>(over_vertices);
  const Eigen::SelfAdjointEigenSolver<MatrixX> principal(over_vertices);
  const VectorX& variance = principal.eigenvalues();  // rising
  double left = variance.sum() * (1 - kept);
  Index dropped = 0;
  while (dropped + 1 < modes && variance(dropped) < left) left -= variance(dropped++);
  basis_ = across * root.matrixU().solve(principal.eigenvectors().rightCols(modes - dropped));
}

std::shared_ptr<const VectorX> SurfaceField::offset_m(const VectorX& coefficients) const {
  const std::lock_guard lock(mutex_);
  if (!last_offset_m_ || last_coefficients_ != coefficients) {
    last_offset_m_ = std::make_shared<const VectorX>(basis_ * coefficients);
    last_coefficients_ = coefficients;
  }
  return last_offset_m_;
}

}  // namespace palpate::estimation
