// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/foreign_points.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/reconstruction/build_object.hpp"

namespace palpate::reconstruction::foreign_points_test {
namespace {

using testing::Contains;
using testing::HasSubstr;

constexpr double side_m = 0.1, sigma_m = 5e-4;
const std::vector<Touch> on_top{{Vec3(0.05, 0.05, side_m), -Vec3::UnitZ(), 0.01}};

PointCloud joined(const PointCloud& a, const PointCloud& b) {
  PointCloud out = a;
  out.points_m.conservativeResize(a.points_m.rows() + b.points_m.rows(), 3);
  out.normals.conservativeResize(a.normals.rows() + b.normals.rows(), 3);
  out.points_m.bottomRows(b.points_m.rows()) = b.points_m;
  out.normals.bottomRows(b.normals.rows()) = b.normals;
  return out;
}

/// Top and sides of a block, `points` on each.
PointCloud block(const Vec3& low, const Vec3& size, int points) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> share(0, 1);
  std::normal_distribution<double> noise(0, sigma_m);
  PointCloud cloud;
  cloud.sigma_m = VectorX::Constant(1, sigma_m);
  cloud.points_m.resize(5 * points, 3), cloud.normals.resize(5 * points, 3);
  for (int face = 0; face < 5; ++face)
    for (int i = 0; i < points; ++i) {
      const int axis = face / 2;
      Vec3 at(share(random), share(random), share(random)), normal = Vec3::Zero();
      normal(axis) = face % 2 == 0 && axis < 2 ? -1 : 1;
      at(axis) = normal(axis) < 0 ? 0 : 1;
      cloud.points_m.row(face * points + i) = low + at.cwiseProduct(size) + noise(random) * normal;
      cloud.normals.row(face * points + i) = normal;
    }
  return cloud;
}

PointCloud wall(int points) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> share(-1, 1);
  PointCloud cloud;
  cloud.points_m.resize(points, 3), cloud.normals.resize(points, 3);
  for (int i = 0; i < points; ++i) {
    cloud.points_m.row(i) << 1.5, share(random), 1 + share(random);
    cloud.normals.row(i) << -1, 0, 0;
  }
  return cloud;
}

BuiltObject built(const PointCloud& cloud, const std::vector<Touch>& touched) {
  FuseOptions fuse;
  fuse.support = Plane{Vec3::Zero(), Vec3::UnitZ()};
  fuse.touched = touched;
  BuildOptions options;
  options.mesh.tetrahedra = 1500;
  return build_object({cloud}, fuse, {}, options);
}

const PointCloud cube = block(Vec3::Zero(), Vec3::Constant(side_m), 4000);

TEST(ForeignPoints, WhatStandsBesideTheObjectIsNoPartOfIt) {
  const PointCloud room = joined(joined(cube, block(Vec3(0.2, 0, 0), Vec3(0.1, 0.1, 0.15), 3000)), wall(5000));
  const BuiltObject seen = built(room, on_top), alone = built(cube, on_top);
  EXPECT_NEAR(alone.check.volume_m3, std::pow(side_m, 3), 0.03 * std::pow(side_m, 3));
  EXPECT_NEAR(seen.check.volume_m3, alone.check.volume_m3, 1e-3 * alone.check.volume_m3);
  EXPECT_THAT(seen.model.warnings, Contains(HasSubstr("50 % of what the views show stands about ")));
  EXPECT_THAT(alone.model.warnings, Not(Contains(HasSubstr("beside the object"))));
  EXPECT_THROW(built(room, {}), Error) << "what was touched is not known: cube, box and wall enclose nothing";
}

TEST(ForeignPoints, WhatStandsNearIsAPartOfIt) {
  std::vector<PointCloud> two{joined(cube, block(Vec3(side_m + 0.015, 0, 0), Vec3::Constant(side_m), 4000))};
  EXPECT_EQ(drop_foreign(two, on_top).share, 0);
  EXPECT_EQ(two[0].points_m.rows(), 40000);
}

TEST(ForeignPoints, AHiddenSideThatWasTouchedTellsNothing) {
  std::vector<PointCloud> two{joined(cube, block(Vec3(0.3, 0, 0), Vec3::Constant(side_m), 4000))};
  EXPECT_EQ(drop_foreign(two, {{Vec3(0.2, 0.05, 0.05), Vec3::UnitX(), 0.01}}).share, 0) << "10 cm from either";
  EXPECT_NEAR(drop_foreign(two, on_top).share, 0.5, 1e-12);
}

TEST(ForeignPoints, FewPointsAreNoise) {
  std::vector<PointCloud> noisy{joined(cube, block(Vec3(0.2, 0, 0), Vec3::Constant(0.01), 20))};
  EXPECT_EQ(drop_foreign(noisy, on_top).share, 0);
  EXPECT_EQ(noisy[0].points_m.rows(), cube.points_m.rows() + 100);
}

// What a noisy camera sees of a table a metre behind the object stands above it here and there: no thing to speak of, but cells that reach so far
// are as wide as the object.
TEST(ForeignPoints, FewThatAreFarMakeNoCellsWide) {
  const PointCloud far = joined(block(Vec3(1.4, 2, 0), Vec3::Constant(0.02), 20), block(Vec3(-1.5, 1.2, 0), Vec3::Constant(0.02), 20));
  std::vector<PointCloud> noisy{joined(cube, far)};
  EXPECT_EQ(drop_foreign(noisy, on_top).share, 0) << "nothing that anybody needs to be told of";
  EXPECT_EQ(noisy[0].points_m, cube.points_m);
  const BuiltObject seen = built(joined(cube, far), on_top);
  EXPECT_NEAR(seen.check.volume_m3, std::pow(side_m, 3), 0.03 * std::pow(side_m, 3));
  EXPECT_LT(seen.model.surface.vertices_m.cwiseAbs().maxCoeff(), 1.1 * side_m);
}

TEST(ForeignPoints, LeaveEveryPointItsNormalAndNoise) {
  PointCloud room = joined(cube, wall(5000));
  room.sigma_m = VectorX::Constant(room.points_m.rows(), 2 * sigma_m);
  room.sigma_m.head(cube.points_m.rows()).setConstant(sigma_m);
  std::vector<PointCloud> clouds{room, cube};
  const ForeignPoints foreign = drop_foreign(clouds, on_top);
  EXPECT_NEAR(foreign.share, 5.0 / 45, 1e-12);
  EXPECT_NEAR(foreign.nearest_m, 1.4, 0.1);
  EXPECT_EQ(clouds[0].points_m, cube.points_m);
  EXPECT_EQ(clouds[0].normals, cube.normals);
  EXPECT_EQ(clouds[0].sigma_m.size(), cube.points_m.rows());
  EXPECT_EQ(clouds[0].sigma_m.maxCoeff(), sigma_m);
  EXPECT_EQ(clouds[1].points_m, cube.points_m);
}

}  // namespace
}  // namespace palpate::reconstruction::foreign_points_test
