// SPDX-License-Identifier: Apache-2.0
// A triangle mesh as a smooth rigid surface.
#include <array>
#include <cmath>
#include <unordered_map>

#include "palpate/core/error.hpp"
#include "palpate/fem/contact/rigid_shape.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/geometry/winding_number.hpp"

namespace palpate::fem {
namespace {

struct Cell {
  int i, j, k;
  bool operator==(const Cell& o) const { return i == o.i && j == o.j && k == o.k; }
};
struct CellHash {
  std::size_t operator()(const Cell& c) const {
    return static_cast<std::size_t>(c.i) * 73856093u ^ static_cast<std::size_t>(c.j) * 19349663u ^
           static_cast<std::size_t>(c.k) * 83492791u;
  }
};

// Uniform cubic B-spline at t in [0, 1): weights of the four nearest coefficients, first and second derivative.
struct Spline {
  std::array<double, 4> w, d, b;
  explicit Spline(double t) {
    const double s = 1 - t;
    w = {s * s * s / 6, (4 - 6 * t * t + 3 * t * t * t) / 6, (4 - 6 * s * s + 3 * s * s * s) / 6, t * t * t / 6};
    d = {-s * s / 2, (3 * t * t - 4 * t) / 2, (4 * s - 3 * s * s) / 2, t * t / 2};
    b = {s, 3 * t - 2, 3 * s - 2, t};
  }
};

class MeshShape final : public RigidShape {
 public:
  MeshShape(const TriMesh& mesh, double spacing) : tree_(mesh), winding_(mesh) {
    low_ = mesh.vertices_m.colwise().minCoeff().transpose();
    high_ = mesh.vertices_m.colwise().maxCoeff().transpose();
    diagonal_ = (high_ - low_).norm();
    spacing_ = spacing > 0 ? spacing : diagonal_ / 40;
  }

  bool at(const Vec3& y, double, ShapePoint& out) const override {
    // Outside the box there is nothing to penetrate.
    if (((y - low_).array() < -2 * spacing_).any() || ((y - high_).array() > 2 * spacing_).any()) return false;
    const Vec3 scaled = (y - low_) / spacing_;
    const Vec3 floor = scaled.array().floor();
    const Spline x(scaled.x() - floor.x()), v(scaled.y() - floor.y()), z(scaled.z() - floor.z());
    double value = 0;
    Vec3 gradient = Vec3::Zero();
    Mat3 hessian = Mat3::Zero();
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 4; ++k) {
          const double c = coefficient({int(floor.x()) - 1 + i, int(floor.y()) - 1 + j, int(floor.z()) - 1 + k});
          value += c * x.w[i] * v.w[j] * z.w[k];
          gradient += c * Vec3(x.d[i] * v.w[j] * z.w[k], x.w[i] * v.d[j] * z.w[k], x.w[i] * v.w[j] * z.d[k]);
          hessian(0, 0) += c * x.b[i] * v.w[j] * z.w[k];
          hessian(1, 1) += c * x.w[i] * v.b[j] * z.w[k];
          hessian(2, 2) += c * x.w[i] * v.w[j] * z.b[k];
          hessian(0, 1) += c * x.d[i] * v.d[j] * z.w[k];
          hessian(0, 2) += c * x.d[i] * v.w[j] * z.d[k];
          hessian(1, 2) += c * x.w[i] * v.d[j] * z.d[k];
        }
    out = {};
    out.gap_m = value;
    out.normal = gradient / spacing_;
    hessian(1, 0) = hessian(0, 1);
    hessian(2, 0) = hessian(0, 2);
    hessian(2, 1) = hessian(1, 2);
    out.curvature = hessian / (spacing_ * spacing_);
    return true;
  }
  double bounding_radius_m() const override { return 0.5 * diagonal_ + 4 * spacing_; }
  Vec3 bounding_centre_m() const override { return 0.5 * (low_ + high_); }

 private:
  double distance(const Cell& c) const {
    if (const auto found = distances_.find(c); found != distances_.end()) return found->second;
    const Vec3 p = low_ + spacing_ * Vec3(c.i, c.j, c.k);
    const double d = std::sqrt(tree_.closest(p).squared_distance_m2);
    return distances_[c] = winding_(p) > 0.5 ? -d : d;
  }
  // Quasi-interpolation, c = f - (second differences) / 6: cubic polynomials come back exactly.
  double coefficient(const Cell& c) const {
    if (const auto found = coefficients_.find(c); found != coefficients_.end()) return found->second;
    const double f = distance(c);
    const double around = distance({c.i - 1, c.j, c.k}) + distance({c.i + 1, c.j, c.k}) + distance({c.i, c.j - 1, c.k}) +
                          distance({c.i, c.j + 1, c.k}) + distance({c.i, c.j, c.k - 1}) + distance({c.i, c.j, c.k + 1});
    return coefficients_[c] = f - (around - 6 * f) / 6;
  }

  geometry::TriangleTree tree_;
  geometry::WindingNumber winding_;
  Vec3 low_, high_;
  double diagonal_ = 0, spacing_ = 0;
  mutable std::unordered_map<Cell, double, CellHash> distances_, coefficients_;
};

}  // namespace

RigidShapePtr mesh_shape(const TriMesh& mesh, double spacing_m) {
  if (mesh.triangles.rows() == 0) throw Error("has no triangles", "tool.mesh");
  return std::make_shared<MeshShape>(mesh, spacing_m);
}

}  // namespace palpate::fem
