// label: unit
// SPDX-License-Identifier: Apache-2.0
// The low rank field is the Gaussian process that it stands for: standard deviation and correlation as stated, everywhere.
#include "palpate/estimation/surface_field.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"
#include "scenes.hpp"

namespace palpate::estimation::surface_field_test {
namespace {

TriMesh cube_surface(double edge_m) {
  return SimulatedSurface::boundary_of(kuhn_block(12, 12, 12, Vec3::Constant(edge_m)), nullptr).rest();
}

TEST(SurfaceField, CovarianceOfAnyTwoVerticesIsTheStatedOne) {
  const TriMesh cube = cube_surface(0.15);
  const double std_m = 5e-4, length_m = 0.04;
  const SurfaceField field(cube, std_m, length_m);
  EXPECT_LT(field.modes(), 300);
  double worst = 0;
  for (Index a = 0; a < cube.vertices_m.rows(); a += 7) {
    for (Index b = 0; b < cube.vertices_m.rows(); b += 5) {
      const double apart = (cube.vertices_m.row(a) - cube.vertices_m.row(b)).norm() / length_m;
      const double wanted = field.normals().row(a).dot(field.normals().row(b)) * std::exp(-0.5 * apart * apart);
      const double made = field.basis().row(a).dot(field.basis().row(b)) / (std_m * std_m);
      worst = std::max(worst, std::abs(made - wanted));
    }
  }
  EXPECT_LT(worst, 0.05);
}

TEST(SurfaceField, RefusesLengthsThatAreNone) {
  const TriMesh cube = cube_surface(0.15);
  EXPECT_THROW(SurfaceField(cube, 0, 0.04), Error);
  EXPECT_THROW(SurfaceField(cube, 1e-3, -1), Error);
  EXPECT_THROW(SurfaceField({}, 1e-3, 0.04), Error);
}

}  // namespace
}  // namespace palpate::estimation::surface_field_test
