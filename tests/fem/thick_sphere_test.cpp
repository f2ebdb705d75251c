// label: oracle
// SPDX-License-Identifier: Apache-2.0
// Thick sphere under inner pressure (Lame): u(r) = p a^3 / (E (b^3 - a^3)) [(1 - 2 nu) r + (1 + nu) b^3 / (2 r^2)].
#include <gtest/gtest.h>

#include "fem_meshes.hpp"
#include "palpate/fem/assembly.hpp"
#include "palpate/fem/contact/surface_points.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem::thick_sphere_test {
namespace {

constexpr double kInner = 0.05, kOuter = 0.1, kYoung = 20000, kPressure = 100;

// One face of the cubed sphere: its four sides are planes of symmetry.
double largest_error(int cells, double nu, Dilatation dilatation) {
  TetMesh mesh = to_quadratic(block_mesh(cells, cells, cells, {1, 1, 1}));
  Boundary boundary;
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    const Vec3 p = node_position(mesh, i);
    const Vec3 ray(std::tan(M_PI / 4 * (2 * p.x() - 1)), std::tan(M_PI / 4 * (2 * p.y() - 1)), 1);
    mesh.nodes_m.row(i) = (kInner + (kOuter - kInner) * p.z()) * ray.normalized().transpose();
    Mat3 axes = Mat3::Zero();
    int count = 0;
    for (int k = 0; k < 2; ++k) {
      if (p(k) > 1e-9 && p(k) < 1 - 1e-9) continue;
      Vec3 normal = Vec3::Unit(k) + (p(k) > 0.5 ? -1 : 1) * Vec3::UnitZ();
      if (count > 0) normal -= normal.dot(axes.col(0)) * axes.col(0);
      axes.col(count++) = normal.normalized();
    }
    if (count > 0) boundary.constraints.push_back({i, axes, count});
  }
  const Assembly assembly(mesh);
  const SurfacePoints points(mesh, assembly.pattern(), 3);
  std::vector<Eigen::Triplet<double>> load;
  for (Index f = 0; f < points.face_count(); ++f) {
    Eigen::Matrix<double, 3, 6> x;
    for (int a = 0; a < 6; ++a) x.col(a) = node_position(mesh, points.node(f, a));
    if (x.colwise().norm().maxCoeff() > kInner * (1 + 1e-9)) continue;
    for (int q = 0; q < points.per_face(); ++q) {
      const Eigen::Matrix<double, 3, 2> t = x * points.d_shape(q);
      const Vec3 area = t.col(0).cross(t.col(1)) / (2 * points.per_face());
      for (int a = 0; a < 6; ++a)
        for (int k = 0; k < 3; ++k) load.emplace_back(3 * points.node(f, a) + k, 0, -area(k) * points.shape(q)(a));
    }
  }
  boundary.forces.resize(3 * mesh.nodes_m.rows(), 1);
  boundary.forces.setFromTriplets(load.begin(), load.end());
  StaticsOptions options;
  options.dilatation = dilatation;
  const Equilibrium e =
      Statics(mesh, "linear", boundary, options).solve(kYoung, nu, VectorX::Constant(1, kPressure), VectorX());
  const double a3 = std::pow(kInner, 3), b3 = std::pow(kOuter, 3);
  const auto exact = [&](double r) {
    return kPressure * a3 / (kYoung * (b3 - a3)) * ((1 - 2 * nu) * r + (1 + nu) * b3 / (2 * r * r));
  };
  double worst = 0;
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    const Vec3 x = node_position(mesh, i);
    worst = std::max(worst, (e.displacement_m.segment<3>(3 * i) - exact(x.norm()) * x.normalized()).norm());
  }
  return worst / exact(kInner);
}

TEST(ThickSphere, ConvergesAtThirdOrderToLame) {
  const double coarse = largest_error(3, 0.3, Dilatation::pointwise), fine = largest_error(6, 0.3, Dilatation::pointwise);
  EXPECT_LT(fine, 4e-3);
  RecordProperty("errors", std::to_string(coarse) + " " + std::to_string(fine));
  EXPECT_GT(coarse / fine, 5.5);
}

TEST(ThickSphere, AveragedDilatationIsRightNearlyIncompressible) {
  EXPECT_LT(largest_error(6, 0.4999, Dilatation::averaged), 5e-3);
}

}  // namespace
}  // namespace palpate::fem::thick_sphere_test
