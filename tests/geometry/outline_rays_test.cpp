// label: unit
// SPDX-License-Identifier: Apache-2.0
// Rays that pass the outline of what they meet closely: against the closed form of a ball's, and behind and before an edge.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>

#include "geometry/shapes.hpp"
#include "palpate/geometry/ray_bundle.hpp"

namespace palpate::geometry::outline_rays_test {
namespace {

TEST(SurfaceEdges, AreEveryEdgeOnceWithTheTrianglesBesideIt) {
  const TriMesh box = shapes::box(Vec3(1, 2, 3));
  const auto edges = surface_edges(box.triangles);
  ASSERT_EQ(edges.size(), 18u);  // 12 triangles, two to an edge
  for (const SurfaceEdge& edge : edges) {
    EXPECT_LT(edge.from, edge.to);
    for (const Index t : edge.triangles) {
      ASSERT_GE(t, 0);
      for (const Index vertex : {edge.from, edge.to}) EXPECT_TRUE((box.triangles.row(t).array() == vertex).any());
    }
    EXPECT_NE(edge.triangles[0], edge.triangles[1]);
  }
  EXPECT_TRUE(surface_edges(Triangles(0, 3)).empty());

  // Where the surface ends, or three meet, there is no other side.
  Triangles fan(3, 3);
  fan << 0, 1, 2, 0, 1, 3, 0, 1, 4;
  int open = 0;
  for (const SurfaceEdge& edge : surface_edges(fan)) open += edge.triangles[1] < 0;
  EXPECT_EQ(open, 7);
  int inner = 0;
  for (const SurfaceEdge& edge : surface_edges(fan.topRows(2))) inner += edge.triangles[1] >= 0;
  EXPECT_EQ(inner, 1);
}

/// A picture of so many pixels a side that looks along z, a pixel being 1 / `focal` wide.
Points pinhole(int side, double focal) {
  Points directions(Index(side) * side, 3);
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column)
      directions.row(Index(row) * side + column) << (column - 0.5 * side) / focal, (row - 0.5 * side) / focal, 1;
  return directions;
}

struct Seen {
  Points directions;
  std::vector<RayHit> hits;
  std::vector<char> beside;
};

Seen seen(const TriMesh& surface, const Points& directions, double margin_rad, const Vec3& eye = Vec3::Zero(), const Mat3& turn = Mat3::Identity()) {
  const RayBundle bundle(directions);
  Seen out{directions, bundle.meet(surface.vertices_m, surface.triangles, eye, turn).value(), {}};
  out.beside = bundle.beside_outline(surface.vertices_m, surface.triangles, surface_edges(surface.triangles), eye, turn, out.hits, margin_rad).value();
  return out;
}

TriMesh both(const TriMesh& a, const TriMesh& b) {
  TriMesh sum;
  sum.vertices_m.resize(a.vertices_m.rows() + b.vertices_m.rows(), 3);
  sum.vertices_m << a.vertices_m, b.vertices_m;
  sum.triangles.resize(a.triangles.rows() + b.triangles.rows(), 3);
  sum.triangles << a.triangles, (b.triangles.array() + a.vertices_m.rows()).matrix();
  return sum;
}

TEST(BesideOutline, OfABallIsARing) {
  constexpr double radius = 0.1, away = 1, margin = 0.012;
  const double outline = std::asin(radius / away);  // half the angle that the ball fills
  const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized()).toRotationMatrix();
  const Vec3 eye(3, -1, 2);
  const Seen picture = seen(shapes::sphere(radius, 5, eye + turn * Vec3(0, 0, away)), pinhole(120, 500), margin, eye, turn);
  int inside = 0, ring = 0;
  for (Index i = 0; i < picture.directions.rows(); ++i) {
    const auto ray = static_cast<std::size_t>(i);
    const Vec3 direction = picture.directions.row(i).transpose().normalized();
    const double from_outline = outline - std::acos(direction.z());
    constexpr double facets = 0.0015;
    const bool clear = from_outline < -facets || from_outline > margin + facets;
    const bool in_ring = from_outline > facets && from_outline < margin - facets;
    if (clear || in_ring) {
      EXPECT_EQ(picture.beside[ray] != 0, in_ring) << from_outline;
    }
    ring += in_ring;
    inside += clear && from_outline > 0;
  }
  EXPECT_GT(ring, 500);
  EXPECT_GT(inside, 3000);
}

TEST(BesideOutline, OfWhatStandsBeforeAnotherIsOnBothSidesAndWhatIsHiddenHasNone) {
  // A plate before a wide one, and a third that the wide one hides.
  const TriMesh front = shapes::box(Vec3(0.1, 0.1, 0.01), Vec3(-0.05, -0.05, 0.8)), wide = shapes::box(Vec3(0.6, 0.6, 0.01), Vec3(-0.3, -0.3, 1));
  const TriMesh hidden = shapes::box(Vec3(0.1, 0.1, 0.01), Vec3(0.1, 0.1, 1.2));
  constexpr double margin = 0.01;
  const Seen picture = seen(both(both(front, wide), hidden), pinhole(120, 300), margin);
  int on_front = 0, on_wide = 0, clear = 0;
  for (Index i = 0; i < picture.directions.rows(); ++i) {
    const Vec3 ray = picture.directions.row(i).transpose();
    const double from_front = std::max(std::abs(ray.x()), std::abs(ray.y())) - 0.05 / 0.8;
    const double from_wide = std::max(std::abs(ray.x()), std::abs(ray.y())) - 0.3;
    const char beside = picture.beside[static_cast<std::size_t>(i)];
    constexpr double close = 1e-3;
    // Corners are round: only what lies beside the middle of a side is asked.
    const bool beside_front = std::min(std::abs(ray.x()), std::abs(ray.y())) < 0.05;
    const bool near = beside_front && std::abs(from_front) < margin - close;
    const bool far = from_front < -margin - close || (from_front > 1.5 * margin && from_wide < -margin - close);
    if (near || far) {
      EXPECT_EQ(beside != 0, near) << ray.transpose();
    }
    on_front += near && from_front < 0;
    on_wide += near && from_front > 0;
    clear += far;
  }
  EXPECT_GT(on_front, 200);
  EXPECT_GT(on_wide, 200);
  EXPECT_GT(clear, 5000);
}

TEST(BesideOutline, SaysNothingWhereTheSurfaceReachesAroundTheEye) {
  const TriMesh around = shapes::sphere(1, 2);
  const RayBundle bundle(pinhole(10, 50));
  EXPECT_FALSE(bundle.beside_outline(around.vertices_m, around.triangles, surface_edges(around.triangles), Vec3::Zero(), Mat3::Identity(),
                                     std::vector<RayHit>(100), 0.01));
}

}  // namespace
}  // namespace palpate::geometry::outline_rays_test
