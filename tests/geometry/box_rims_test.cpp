// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/box_rims.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "palpate/lab/box_surface.hpp"

namespace palpate::geometry::box_rims_test {
namespace {

// Two upright bars, 20 mm and 40 mm wide.
TriMesh two_bars() {
  TriMesh thin = lab::box_surface({0, 0, 0}, {0.02, 0.02, 0.1}, 8);
  const TriMesh thick = lab::box_surface({0.1, 0, 0}, {0.14, 0.04, 0.1}, 8);
  const Index vertices = thin.vertices_m.rows(), triangles = thin.triangles.rows();
  thin.vertices_m.conservativeResize(vertices + thick.vertices_m.rows(), 3);
  thin.vertices_m.bottomRows(thick.vertices_m.rows()) = thick.vertices_m;
  thin.triangles.conservativeResize(triangles + thick.triangles.rows(), 3);
  thin.triangles.bottomRows(thick.triangles.rows()) = thick.triangles.array() + int(vertices);
  return thin;
}

TEST(FinerAtRims, EachLegHasItsOwn) {
  const auto finer = finer_at_rims({-1, -1, -0.01}, {1, 1, 0.03}, two_bars());
  for (const double left_m : {0.0, 0.1}) {
    const double width_m = left_m == 0 ? 0.02 : 0.04, edge_m = 0.12 * 4 * width_m / (2 * std::sqrt(EIGEN_PI));
    std::vector<FinerNear> of_leg;
    std::copy_if(finer.begin(), finer.end(), std::back_inserter(of_leg), [&](const FinerNear& one) { return (one.point_m.x() > 0.06) == (left_m > 0); });
    for (const FinerNear& one : of_leg) {
      EXPECT_NEAR(one.point_m.z(), 0.03, 1e-12);
      EXPECT_NEAR(one.edge_m, edge_m, 1e-9) << "an eighth of the leg or so";
      EXPECT_GE(one.radius_m, 0.5 * edge_m);
    }
    for (int side = 0; side < 4; ++side)
      for (double along = 0; along <= 1; along += 0.01) {  // no place on the rim is left out
        const double across = side % 2 * width_m;
        const Vec3 at = side < 2 ? Vec3(left_m + along * width_m, across, 0.03) : Vec3(left_m + across, along * width_m, 0.03);
        EXPECT_TRUE(std::any_of(of_leg.begin(), of_leg.end(), [&](const FinerNear& one) { return (one.point_m - at).norm() <= edge_m; })) << at.transpose();
      }
    EXPECT_LT(of_leg.size(), 4 * width_m / (0.3 * edge_m)) << "not much more often than needed";
  }
}

TEST(FinerAtRims, ASoupOfTrianglesHasTheSame) {
  const TriMesh bars = two_bars();
  TriMesh soup;
  soup.vertices_m.resize(3 * bars.triangles.rows(), 3);
  soup.triangles.resize(bars.triangles.rows(), 3);
  for (Index t = 0; t < bars.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      soup.vertices_m.row(3 * t + k) = bars.vertices_m.row(bars.triangles(t, k));
      soup.triangles(t, k) = int(3 * t + k);
    }
  const auto of_soup = finer_at_rims({-1, -1, -0.01}, {1, 1, 0.03}, soup), of_mesh = finer_at_rims({-1, -1, -0.01}, {1, 1, 0.03}, bars);
  ASSERT_EQ(of_soup.size(), of_mesh.size());
  for (std::size_t k = 0; k < of_soup.size(); ++k) EXPECT_NEAR(of_soup[k].edge_m, of_mesh[k].edge_m, 1e-12);
}

TEST(FinerAtRims, TheTwoOfABarThatIsHeldInTheMiddleAreApart) {
  const auto finer = finer_at_rims({-1, -1, 0.04}, {1, 1, 0.06}, lab::box_surface({0, 0, 0}, {0.02, 0.02, 0.1}, 1));  // sides of two triangles
  ASSERT_FALSE(finer.empty());
  for (const FinerNear& one : finer) {
    EXPECT_NEAR(std::abs(one.point_m.z() - 0.05), 0.01, 1e-12);
    EXPECT_NEAR(one.edge_m, 0.12 * 0.08 / (2 * std::sqrt(EIGEN_PI)), 1e-9);
  }
}

TEST(FinerAtRims, WhatOnlyGrazesASideIsNone) {
  TriMesh bars = two_bars();
  for (Index v = 0; v < bars.vertices_m.rows(); ++v)
    if (bars.vertices_m.row(v).isApprox(Eigen::RowVector3d(0.02, 0.02, 0))) bars.vertices_m(v, 2) = -1e-4;  // a burr below the box
  const auto burr = finer_at_rims({-1, -1, -5e-5}, {1, 1, 0.03}, bars);
  ASSERT_FALSE(burr.empty());
  for (const FinerNear& one : burr) EXPECT_NEAR(one.point_m.z(), 0.03, 1e-12);
  EXPECT_TRUE(finer_at_rims({-1, -1, -1}, {1, 1, -1e-4}, bars).empty()) << "touches the side with one vertex";
}

TEST(FinerAtRims, NoneWhereTheSurfaceIsInsideOrOutside) {
  EXPECT_TRUE(finer_at_rims({-1, -1, -1}, {1, 1, 1}, two_bars()).empty());
  EXPECT_TRUE(finer_at_rims({2, 2, 2}, {3, 3, 3}, two_bars()).empty());
  const auto one_leg = finer_at_rims({-1, -1, -0.01}, {0.05, 1, 0.03}, two_bars());  // ends between the legs
  ASSERT_FALSE(one_leg.empty());
  for (const FinerNear& one : one_leg) EXPECT_LT(one.point_m.x(), 0.021);
}

TEST(FinerAtRims, ABoxMayEndInTheMiddleOfAFace) {
  const auto corner = finer_at_rims({-1, -1, -0.01}, {0.01, 1, 0.03}, two_bars());  // x = 10 mm cuts through the thin leg, too
  const auto on = [&](int axis, double at) {
    return std::count_if(corner.begin(), corner.end(), [&](const FinerNear& one) { return std::abs(one.point_m(axis) - at) < 1e-12; });
  };
  EXPECT_GT(on(0, 0.01), 0);
  EXPECT_GT(on(2, 0.03), 0);
  for (const FinerNear& one : corner) {
    EXPECT_LE(one.point_m.x(), 0.01 + 1e-12);
    EXPECT_LE(one.point_m.z(), 0.03 + 1e-12);
  }
}

}  // namespace
}  // namespace palpate::geometry::box_rims_test
