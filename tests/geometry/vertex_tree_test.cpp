// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The nearest of some points, against asking every one of them, and against triangles that are shrunk to these points.
#include "palpate/geometry/vertex_tree.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "palpate/core/error.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::geometry {
namespace {

/// A bumpy sphere; every third point stands twice, so that there are ties.
Points some_points(Index count, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Points points(count, 3);
  for (Index i = 0; i < count; ++i) {
    const Vec3 d = Vec3(normal(random), normal(random), normal(random)).normalized();
    points.row(i) = (0.1 + 0.01 * std::sin(9 * d.x())) * d;
    if (i % 3 == 2) points.row(i) = points.row(i - 1);
  }
  return points;
}

NearestVertex by_asking_all(const Points& points, const Vec3& p) {
  NearestVertex best{-1, std::numeric_limits<double>::infinity()};
  for (Index i = 0; i < points.rows(); ++i) {
    const Vec3 d = points.row(i).transpose() - p;
    const double squared = d.x() * d.x() + d.y() * d.y() + d.z() * d.z();
    if (squared < best.squared_distance_m2) best = {i, squared};
  }
  return best;
}

TEST(VertexTree, NamesTheVertexThatAskingAllNames) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  for (const Index count : {1, 8, 9, 2000}) {
    Points points = some_points(count, random);
    VertexTree tree(points);
    TriMesh shrunk{points, Triangles(count, 3)};
    for (Index v = 0; v < count; ++v) shrunk.triangles.row(v).setConstant(v);
    TriangleTree triangles(shrunk);
    for (int round = 0; round < 3; ++round) {
      Index last = -1;
      for (int q = 0; q < 500; ++q) {
        const Vec3 p = q % 5 == 0 ? Vec3(points.row(q % count)) : Vec3(0.09 * Vec3(normal(random), normal(random), normal(random)));
        const NearestVertex truth = by_asking_all(points, p), found = tree.nearest(p), hinted = tree.nearest(p, last);
        ASSERT_EQ(found.vertex, truth.vertex);
        ASSERT_EQ(found.squared_distance_m2, truth.squared_distance_m2);
        ASSERT_EQ(hinted.vertex, truth.vertex);
        ASSERT_EQ(triangles.closest(p).triangle, truth.vertex) << "what took its place";
        last = found.vertex;
      }
      for (Index i = 0; i < count; ++i) points.row(i) += 0.004 * (round + 1) * Eigen::RowVector3d(0, 0, std::cos(30 * points(i, 0)));
      tree.refit(points);
      triangles.refit(points);
    }
  }
}

TEST(VertexTree, RefusesWhatIsNoPoint) {
  std::mt19937_64 random(6);
  Points points = some_points(20, random);
  VertexTree tree(points);
  EXPECT_THROW(VertexTree(Points(0, 3)), Error);
  EXPECT_THROW(tree.refit(Points::Zero(19, 3)), Error);
  points(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(tree.refit(points), Error);
  EXPECT_EQ(tree.nearest(Vec3(0, std::numeric_limits<double>::infinity(), 0)).vertex, -1);
}

}  // namespace
}  // namespace palpate::geometry
