// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/perspective_grid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "geometry/shapes.hpp"

namespace palpate::geometry {
namespace {

/// Triangles of all sizes, needles, and some that are a line or a point.
TriMesh all_shapes(int count, int seed) {
  TriMesh m;
  m.vertices_m.resize(3 * count, 3);
  m.triangles.resize(count, 3);
  std::mt19937 rng(seed);
  std::normal_distribution<double> g;
  std::uniform_real_distribution<double> u;
  const auto any = [&] { return Vec3(g(rng), g(rng), g(rng)); };
  for (Index i = 0; i < count; ++i) {
    const double size = std::exp2(-12 * u(rng)), thinness = i % 2 == 0 ? 1 : std::exp2(-30 * u(rng));
    const Vec3 a = 0.5 * any(), along = i % 11 == 5 ? Vec3(Vec3::Zero()) : Vec3(size * any());
    m.vertices_m.row(3 * i) = a;
    m.vertices_m.row(3 * i + 1) = a + along;
    m.vertices_m.row(3 * i + 2) = a + u(rng) * along + (i % 11 > 8 || i % 11 == 5 ? 0.0 : thinness * size) * any();
    m.triangles.row(i) << 3 * i, 3 * i + 1, 3 * i + 2;
  }
  return m;
}

Vec3 corner(const TriMesh& m, Index triangle, Index k) { return m.vertices_m.row(m.triangles(triangle, k)); }

/// Every triangle by itself, in its own plane and in long double (Moller and Trumbore). @returns infinity for a miss
long double nearest_of_all(const TriMesh& m, const Vec3& eye, const Vec3& direction) {
  using Vec3L = Eigen::Matrix<long double, 3, 1>;
  const Vec3L along = direction.cast<long double>();
  long double nearest = std::numeric_limits<long double>::infinity();
  for (Index t = 0; t < m.triangles.rows(); ++t) {
    const auto v = [&](Index k) { return Vec3L(corner(m, t, k).cast<long double>()); };
    const Vec3L e1 = v(1) - v(0), e2 = v(2) - v(0), h = along.cross(e2);
    const long double det = e1.dot(h);
    if (det == 0) continue;
    const Vec3L s = eye.cast<long double>() - v(0), q = s.cross(e1);
    const long double u = s.dot(h) / det, w = along.dot(q) / det, range = e2.dot(q) / det;
    if (u >= 0 && w >= 0 && u + w <= 1 && range >= 0) nearest = std::min(nearest, range);
  }
  return nearest;
}

struct Scene {
  TriMesh surface;
  Vec3 eye;
};

class RaysFromAnEye : public testing::TestWithParam<Scene> {
 protected:
  /// The tree's digits. @returns whether there is a hit
  bool same(const TriangleTree& tree, const PerspectiveGrid& grid, const Vec3& direction) const {
    const auto expected = tree.cast(GetParam().eye, direction), hit = grid.cast(direction);
    EXPECT_EQ(hit.has_value(), expected.has_value()) << direction.transpose();
    if (!hit || !expected) return false;
    EXPECT_EQ(hit->range_m, expected->range_m);
    if (hit->triangle == expected->triangle) {
      EXPECT_EQ(hit->barycentric, expected->barycentric);
    } else {  // two that are hit at one range: on what they share
      Vec3 one = Vec3::Zero(), other = Vec3::Zero();
      for (Index k = 0; k < 3; ++k) {
        one += hit->barycentric(k) * corner(tree.mesh(), hit->triangle, k);
        other += expected->barycentric(k) * corner(tree.mesh(), expected->triangle, k);
      }
      EXPECT_LT((one - other).norm(), 1e-14 * (1 + (one - GetParam().eye).norm()));
    }
    return true;
  }
};

TEST_P(RaysFromAnEye, MeetWhatTheTreeSaysWithTheSameDigits) {
  const auto& [surface, eye] = GetParam();
  const TriangleTree tree(surface);
  const PerspectiveGrid grid(surface.vertices_m, surface.triangles, eye);
  ASSERT_TRUE(grid.in_view());
  std::mt19937 rng(3);
  std::normal_distribution<double> g;
  std::uniform_int_distribution<Index> pick(0, static_cast<Index>(surface.triangles.rows()) - 1);
  const Vec3 middle = surface.vertices_m.colwise().mean();
  const double size = (surface.vertices_m.rowwise() - middle.transpose()).rowwise().norm().maxCoeff();
  int hits = 0;
  for (int i = 0; i < 3000; ++i) {
    const Index t = pick(rng);
    const Vec3 near = corner(surface, t, 0) + 1e-3 * size * Vec3(g(rng), g(rng), g(rng));
    const Vec3 wide = middle + size * Vec3(g(rng), g(rng), g(rng));
    const Vec3 towards = (i % 2 == 0 ? near : wide) - eye;
    hits += same(tree, grid, i % 3 == 0 ? Vec3(towards.normalized()) : towards);
  }
  EXPECT_GT(hits, 100);
}

TEST_P(RaysFromAnEye, MeetTheNearestOfAllTriangles) {
  const auto& [surface, eye] = GetParam();
  const PerspectiveGrid grid(surface.vertices_m, surface.triangles, eye);
  std::mt19937 rng(4);
  std::normal_distribution<double> g;
  const Vec3 middle = surface.vertices_m.colwise().mean();
  const double size = (surface.vertices_m.rowwise() - middle.transpose()).rowwise().norm().maxCoeff();
  int hits = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec3 direction = (middle + 0.4 * size * Vec3(g(rng), g(rng), g(rng)) - eye).normalized();
    const auto hit = grid.cast(direction);
    const long double nearest = nearest_of_all(surface, eye, direction);
    ASSERT_EQ(hit.has_value(), std::isfinite(nearest)) << "ray " << i;
    if (!hit) continue;
    ++hits;
    EXPECT_NEAR(hit->range_m, static_cast<double>(nearest), 1e-9 * size);
    EXPECT_NEAR(hit->barycentric.sum(), 1, 1e-12);
  }
  EXPECT_GT(hits, 20);
}

TEST_P(RaysFromAnEye, ThroughCornersAndAlongEdgesMeetWhatTheTreeSays) {
  const auto& [surface, eye] = GetParam();
  const TriangleTree tree(surface);
  const PerspectiveGrid grid(surface.vertices_m, surface.triangles, eye);
  for (Index t = 0; t < surface.triangles.rows(); ++t)
    for (Index k = 0; k < 3; ++k) {
      const Vec3 a = corner(surface, t, k), b = corner(surface, t, (k + 1) % 3);
      for (const double at : {0.0, 0.3, 0.5, 1 - 1e-9}) same(tree, grid, (1 - at) * a + at * b - eye);
    }
}

TEST_P(RaysFromAnEye, MeetASurfaceThatMoved) {
  auto [surface, eye] = GetParam();
  TriangleTree tree(surface);
  const Vec3 middle = surface.vertices_m.colwise().mean();
  const double size = (surface.vertices_m.rowwise() - middle.transpose()).rowwise().norm().maxCoeff();
  for (Index v = 0; v < surface.vertices_m.rows(); ++v) {
    const Vec3 p = (Vec3(surface.vertices_m.row(v)) - middle) / size;
    surface.vertices_m.row(v) += 0.1 * size * Eigen::RowVector3d(std::sin(3 * p.y()), std::cos(2 * p.z()), std::sin(p.x() + p.y()));
  }
  tree.refit(surface.vertices_m);
  const PerspectiveGrid grid(surface.vertices_m, surface.triangles, eye);
  ASSERT_TRUE(grid.in_view());
  std::mt19937 rng(5);
  std::normal_distribution<double> g;
  int hits = 0;
  for (int i = 0; i < 1000; ++i) hits += same(tree, grid, middle + 0.5 * size * Vec3(g(rng), g(rng), g(rng)) - eye);
  EXPECT_GT(hits, 30);
}

TEST_P(RaysFromAnEye, MeetNothingBesideAndBehindAndNowhere) {
  const auto& [surface, eye] = GetParam();
  const PerspectiveGrid grid(surface.vertices_m, surface.triangles, eye);
  const Vec3 middle = surface.vertices_m.colwise().mean(), ahead = middle - eye;
  const double size = (surface.vertices_m.rowwise() - middle.transpose()).rowwise().norm().maxCoeff();
  const Vec3 across = ahead.unitOrthogonal();
  EXPECT_FALSE(grid.cast(-ahead));
  EXPECT_FALSE(grid.cast(across));
  EXPECT_FALSE(grid.cast(ahead + 20 * size * across));
  EXPECT_FALSE(grid.cast(Vec3::Zero()));
  EXPECT_FALSE(grid.cast(Vec3(0, NAN, 1)));
  EXPECT_FALSE(grid.cast(Vec3(INFINITY, 0, 0)));
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, RaysFromAnEye,
    testing::Values(Scene{shapes::box(Vec3::Ones()), Vec3(3, 2.5, 4)}, Scene{shapes::box(Vec3::Ones()), Vec3(0.5, 0.5, 3)},
                    Scene{shapes::sphere(0.8, 3), Vec3(1, -2, 0.5)}, Scene{shapes::sphere(0.06, 4), Vec3(0.3, -0.35, 0.5)},
                    Scene{shapes::sphere(0.8, 3), Vec3(0, 0, 1e4)}, Scene{shapes::sphere(1e-4, 2, Vec3(5, 5, 5)), Vec3(5, 5, 6)},
                    Scene{shapes::torus(0.7, 0.2, 40, 20), Vec3(-1, 1, 1.5)}, Scene{shapes::soup(300, 1), Vec3(0, -6, 1)},
                    Scene{all_shapes(400, 3), Vec3(6, 1, -1)},
                    Scene{shapes::make({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}), Vec3(0.2, 0.3, -2)}));

TEST(PerspectiveGrid, ClosedSurfacesHaveNoHoles) {
  const TriMesh m = shapes::sphere(1, 3);
  const Vec3 eye(2, 1, 2);
  const PerspectiveGrid grid(m.vertices_m, m.triangles, eye);
  int facing = 0;
  for (Index t = 0; t < m.triangles.rows(); ++t)
    for (Index k = 0; k < 3; ++k) {
      const Vec3 a = corner(m, t, k), b = corner(m, t, (k + 1) % 3);
      if ((eye - a).dot(a) <= 0.1 || (eye - b).dot(b) <= 0.1) continue;
      ++facing;
      for (const double at : {0.0, 0.5, 0.7}) {
        const auto hit = grid.cast((1 - at) * a + at * b - eye);
        ASSERT_TRUE(hit);
        EXPECT_NEAR(hit->range_m, 1, 1e-12);
      }
    }
  EXPECT_GT(facing, 500);
}

// Edge-on every direction of the plane holds the whole triangle in a line or less.
TEST(PerspectiveGrid, TrianglesSeenEdgeOnAreMetAsTheTreeSays) {
  const TriMesh m = shapes::make({{-1, 0, 0}, {1, 0, 0}, {0, 0, 1}, {0, 0.5, 2}}, {{0, 1, 2}, {0, 1, 3}, {2, 2, 2}});
  const Vec3 eye(0, 0, 5);  // in the plane of the first
  const TriangleTree tree(m);
  const PerspectiveGrid grid(m.vertices_m, m.triangles, eye);
  ASSERT_TRUE(grid.in_view());
  std::mt19937 rng(6);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 500; ++i) {
    const Vec3 direction = Vec3(u(rng), i % 2 == 0 ? 0 : 0.2 * u(rng), 0) - eye;
    const auto expected = tree.cast(eye, direction), hit = grid.cast(direction);
    ASSERT_EQ(hit.has_value(), expected.has_value());
    if (hit) {
      EXPECT_EQ(hit->range_m, expected->range_m);
    }
  }
}

TEST(PerspectiveGrid, OfTrianglesAtOneRangeTheFirstThatFacesTheEyeIsNamed) {
  const TriMesh m = shapes::make({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 2, 1}, {0, 1, 2}, {0, 1, 2}});
  const Vec3 eye(0.2, 0.2, 3), down(0.01, 0.02, -1);
  EXPECT_EQ(PerspectiveGrid(m.vertices_m, m.triangles, eye).cast(down)->triangle, 1);
}

TEST(PerspectiveGrid, SaysWhenTheSurfaceReachesAroundTheEye) {
  TriMesh m = shapes::box(Vec3::Ones());
  const auto in_view = [&](const Vec3& eye) { return PerspectiveGrid(m.vertices_m, m.triangles, eye).in_view(); };
  EXPECT_TRUE(in_view(Vec3(0.5, 0.5, 2)));
  EXPECT_FALSE(in_view(Vec3(0.5, 0.5, 0.5)));
  EXPECT_FALSE(in_view(Vec3(0.4, 0.5, 0.6)));
  EXPECT_FALSE(in_view(Vec3(0, 0, 0)));
  EXPECT_FALSE(in_view(Vec3(0.5, 0.5, 1.01)));
  EXPECT_FALSE(in_view(Vec3(NAN, 0, 0)));
  m.vertices_m(3, 1) = INFINITY;
  EXPECT_FALSE(in_view(Vec3(0.5, 0.5, 2)));
}

}  // namespace
}  // namespace palpate::geometry
