// label: oracle
// SPDX-License-Identifier: Apache-2.0
// What a box holds of an unstructured mesh, against the closed form of a bar under its own weight.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "palpate/fem/boundary.hpp"
#include "palpate/fem/statics.hpp"
#include "palpate/geometry/box_rims.hpp"
#include "palpate/geometry/tetrahedralise.hpp"
#include "palpate/lab/box_surface.hpp"

namespace palpate::fem::held_in_box_test {
namespace {

constexpr double width_m = 0.03, length_m = 0.09, held_m = 0.0233;

Support box() {
  Support support;
  support.kind = SupportKind::box;
  support.name = "glue";
  support.tolerance_m = 0;
  support.box_min_m = {-1, -1, -1};
  support.box_max_m = {1, 1, held_m};
  return support;
}

/// How long the part is that is free, by how far the bar sinks: with nu = 0 the weight b of a volume moves it by b / E (z L - z^2 / 2)
/// at the height z above the held part, and the work is b^2 A L^3 / (3 E).
double free_length_m(const std::vector<geometry::FinerNear>& finer, const Mat3& turned) {
  TriMesh surface = lab::box_surface({-width_m / 2, -width_m / 2, 0}, {width_m / 2, width_m / 2, length_m}, 6);
  surface.vertices_m = surface.vertices_m * turned.transpose();  // about the bar's axis: the mesher's lattice lies otherwise
  geometry::TetrahedraliseOptions options;
  options.tetrahedra = 3000;
  options.finer = finer;
  const TetMesh mesh = to_quadratic(geometry::tetrahedralise(surface, options).mesh);
  Boundary boundary;
  for (const Index node : support_nodes(mesh, box())) boundary.constraints.push_back({node, Mat3::Identity(), 3});
  const VectorX weight = body_force(mesh) * Vec3(0, 0, -1);
  boundary.forces = MatrixX(weight).sparseView();
  constexpr double young_pa = 1e4;
  const Statics statics(mesh, "linear", boundary, {});
  const Equilibrium sunk = statics.solve(young_pa, 0, VectorX::Constant(1, 1), VectorX(0), nullptr, VectorX());
  EXPECT_TRUE(sunk.converged) << sunk.reason;
  return std::cbrt(3 * young_pa * weight.dot(sunk.displacement_m) / (width_m * width_m));
}

TEST(HeldInBox, TheFreePartBeginsAtTheBox) {
  double worst_coarse_m = 0;
  for (const double turn_rad : {0.0, 0.3, 0.6}) {
    const Mat3 turned = Eigen::AngleAxisd(turn_rad, Vec3::UnitZ()).toRotationMatrix();
    TriMesh surface = lab::box_surface({-width_m / 2, -width_m / 2, 0}, {width_m / 2, width_m / 2, length_m}, 6);
    surface.vertices_m = surface.vertices_m * turned.transpose();
    worst_coarse_m = std::max(worst_coarse_m, free_length_m({}, turned) - (length_m - held_m));
    EXPECT_NEAR(free_length_m(geometry::finer_at_rims(box().box_min_m, box().box_max_m, surface), turned), length_m - held_m, 0.0008) << turn_rad;
  }
  EXPECT_GT(worst_coarse_m, 0.001) << "what short edges at the rim are for";
}

}  // namespace
}  // namespace palpate::fem::held_in_box_test
