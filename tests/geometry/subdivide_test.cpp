// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/subdivide.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "palpate/lab/box_surface.hpp"

namespace palpate::geometry::subdivide_test {
namespace {

const Vec3 place(0.011, -0.007, 0.15);

TriMesh cube() { return lab::box_surface({-0.075, -0.075, 0}, {0.075, 0.075, 0.15}, 10); }

double wished_m(const Vec3& at) { return std::min(0.012, 0.0017 + 0.5 * std::max(0.0, (at - place).norm() - 0.02)); }

double smallest_angle_rad(const TriMesh& mesh) {
  double smallest = EIGEN_PI;
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const auto corner = [&](int i) { return Vec3(mesh.vertices_m.row(mesh.triangles(t, (k + i) % 3))); };
      const Vec3 a = corner(1) - corner(0), b = corner(2) - corner(0);
      smallest = std::min(smallest, std::acos(a.normalized().dot(b.normalized())));
    }
  }
  return smallest;
}

TEST(Subdivided, NoEdgeIsLongerThanWishedAndNoCrackOpens) {
  const TriMesh given = cube(), fine = subdivided(given, wished_m);
  std::map<std::pair<Index, Index>, int> edges;
  double area_m2 = 0, longest = 0;
  for (Index t = 0; t < fine.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(fine.vertices_m.row(fine.triangles(t, k % 3))); };
    area_m2 += 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    for (int k = 0; k < 3; ++k) {
      longest = std::max(longest, (corner(k + 1) - corner(k)).norm() / wished_m(0.5 * (corner(k) + corner(k + 1))));
      ++edges[std::minmax(fine.triangles(t, k), fine.triangles(t, (k + 1) % 3))];
    }
  }
  EXPECT_LE(longest, 1.5) << "1 for a triangle's longest, whose wish its other sides have a part of";
  EXPECT_NEAR(area_m2, 6 * 0.15 * 0.15, 1e-12);
  EXPECT_TRUE(std::all_of(edges.begin(), edges.end(), [](const auto& edge) { return edge.second == 2; }));
  EXPECT_EQ(fine.vertices_m.topRows(given.vertices_m.rows()), given.vertices_m);
  EXPECT_GE(smallest_angle_rad(fine), 0.5 * smallest_angle_rad(given));
}

TEST(Subdivided, IsFineWhereItIsAskedToBeAndNotElsewhere) {
  const TriMesh near = subdivided(cube(), wished_m), all = subdivided(cube(), [](const Vec3&) { return 0.0025; });
  EXPECT_LT(4 * near.triangles.rows(), all.triangles.rows());
}

TEST(Subdivided, WhatIsFineStaysAsItIs) {
  const TriMesh given = cube(), same = subdivided(given, [](const Vec3&) { return 0.022; });
  EXPECT_EQ(same.vertices_m, given.vertices_m);
  EXPECT_EQ(same.triangles, given.triangles);
}

TEST(Subdivided, EndsWhereTheWishIsEndless) {
  const TriMesh many = subdivided(cube(), [](const Vec3&) { return 0.0; });
  EXPECT_GT(many.triangles.rows(), 60000);
  EXPECT_LE(many.triangles.rows(), 4 * 60000);
}

}  // namespace
}  // namespace palpate::geometry::subdivide_test
