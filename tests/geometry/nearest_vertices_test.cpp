// label: unit
// SPDX-License-Identifier: Apache-2.0
// Against all distances, one by one, while vertices and points move by little, by much and back.
#include "palpate/geometry/nearest_vertices.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "refusals.hpp"

namespace palpate::geometry::nearest_vertices_test {
namespace {

double brute_force_m2(const Points& vertices_m, const Vec3& point_m) {
  return (vertices_m.rowwise() - point_m.transpose()).rowwise().squaredNorm().minCoeff();
}

Points scattered(Eigen::Index count, double size_m, std::mt19937_64& random) {
  std::uniform_real_distribution<double> at(-size_m, size_m);
  return Points::NullaryExpr(count, 3, [&] { return at(random); });
}

TEST(NearestVertices, AreThoseOfAllDistancesHoweverTheyMoved) {
  std::mt19937_64 random(3);
  const Points first_m = scattered(2000, 0.05, random);
  NearestVertices vertices(first_m);
  Points points_m = scattered(300, 0.06, random);
  std::vector<NearestVertices::Memory> memory(300);
  // Spacing is some 4 mm: the answers hold over the first moves, and not over the last ones.
  for (const double moved_m : {0.0, 1e-9, 1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 1e-2, 1e-5, 0.0}) {
    const Points there_m = first_m + scattered(first_m.rows(), moved_m, random);
    vertices.move(there_m);
    for (int again = 0; again < 4; ++again) {
      for (Eigen::Index i = 0; i < points_m.rows(); ++i) {
        const auto found = vertices.nearest(points_m.row(i), memory[std::size_t(i)]);
        ASSERT_DOUBLE_EQ(found.squared_distance_m2, brute_force_m2(there_m, points_m.row(i))) << moved_m << ", point " << i;
        ASSERT_DOUBLE_EQ(found.squared_distance_m2, (there_m.row(found.vertex) - points_m.row(i)).squaredNorm());
      }
      points_m += scattered(points_m.rows(), 3e-5, random);
    }
  }
}

// The memory's promise to the letter: the nearest vertex changes by a hair, beyond and short of the middle of two.
TEST(NearestVertices, SwitchWhereTheOtherComesNearer) {
  Points two_m(2, 3);
  two_m << 0, 0, 0, 1, 0, 0;
  NearestVertices vertices(two_m);
  NearestVertices::Memory memory;
  EXPECT_EQ(vertices.nearest({0.2, 0, 0}, memory).vertex, 0);
  EXPECT_EQ(vertices.nearest({0.5 - 1e-9, 0, 0}, memory).vertex, 0);
  EXPECT_EQ(vertices.nearest({0.5 + 1e-9, 0, 0}, memory).vertex, 1);
  two_m(1, 0) = 1.001;
  vertices.move(two_m);
  EXPECT_EQ(vertices.nearest({0.5005 - 1e-9, 0, 0}, memory).vertex, 0);
  two_m(1, 0) = 0.9999;
  vertices.move(two_m);
  EXPECT_EQ(vertices.nearest({0.5, 0, 0}, memory).vertex, 1);
}

TEST(NearestVertices, OfOneIsThatOne) {
  NearestVertices vertices(Points(Points::Constant(1, 3, 0.5)));
  NearestVertices::Memory memory;
  EXPECT_EQ(vertices.nearest({9, 9, 9}, memory).vertex, 0);
  EXPECT_DOUBLE_EQ(vertices.nearest({0.5, 0.5, 1.5}, memory).squared_distance_m2, 1);
}

TEST(NearestVertices, RefuseWhatCannotBeAsked) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  Points three_m = Points::Identity(3, 3);
  EXPECT_THAT(message_of([&] { NearestVertices(Points(0, 3)); }), testing::HasSubstr("at least one vertex"));
  NearestVertices vertices(three_m);
  NearestVertices::Memory memory;
  EXPECT_THAT(message_of([&] { vertices.move(Points::Zero(2, 3)); }), testing::HasSubstr("needs 3 vertices, got 2"));
  three_m(1, 1) = nan;
  EXPECT_THAT(message_of([&] { vertices.move(three_m); }), testing::HasSubstr("not finite"));
  EXPECT_EQ(vertices.nearest({1, 0, 0}, memory).vertex, 0);  // as before
  const auto nowhere = vertices.nearest({nan, 0, 0}, memory);
  EXPECT_EQ(nowhere.vertex, -1);
  EXPECT_TRUE(std::isnan(nowhere.squared_distance_m2));
  EXPECT_EQ(vertices.nearest({1, 0, 0}, memory).vertex, 0);
}

}  // namespace
}  // namespace palpate::geometry::nearest_vertices_test
