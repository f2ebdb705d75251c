// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/triangle_tree.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <random>
#include <thread>
#include <vector>

#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"
#include "refusals.hpp"

namespace palpate::geometry::triangle_tree_test {
namespace {

using Vec3L = Eigen::Matrix<long double, 3, 1>;

long double squared_to_segment(const Vec3L& p, const Vec3L& a, const Vec3L& b) {
  const Vec3L d = b - a;
  const long double l2 = d.squaredNorm();
  const long double s = l2 > 0 ? std::clamp<long double>(d.dot(p - a) / l2, 0, 1) : 0;
  return (p - a - s * d).squaredNorm();
}

/// Another way than the tree's, in long double: foot of the perpendicular if it lies inside (edge planes), else the edges.
long double squared_to_triangle(const Vec3L& p, const Vec3L& a, const Vec3L& b, const Vec3L& c) {
  long double best = std::min({squared_to_segment(p, a, b), squared_to_segment(p, b, c), squared_to_segment(p, c, a)});
  const Vec3L n = (b - a).cross(c - a);
  const long double n2 = n.squaredNorm();
  if (n2 > 0 && n.cross(b - a).dot(p - a) >= 0 && n.cross(c - b).dot(p - b) >= 0 && n.cross(a - c).dot(p - c) >= 0) {
    const long double h = n.dot(p - a);
    best = std::min(best, h * h / n2);
  }
  return best;
}

long double brute_force(const TriMesh& m, const Vec3& p) {
  long double best = std::numeric_limits<long double>::infinity();
  const auto v = [&](Index i) { return Vec3L(m.vertices_m.row(i).transpose().cast<long double>()); };
  for (Eigen::Index i = 0; i < m.triangles.rows(); ++i)
    best = std::min(
        best, squared_to_triangle(p.cast<long double>(), v(m.triangles(i, 0)), v(m.triangles(i, 1)), v(m.triangles(i, 2))));
  return best;
}

void expect_exact(const TriangleTree& tree, const Vec3& p, Index hint) {
  const ClosestPoint c = tree.closest(p, hint);
  const double exact = static_cast<double>(std::sqrt(brute_force(tree.mesh(), p)));
  ASSERT_GE(c.triangle, 0);
  EXPECT_NEAR(std::sqrt(c.squared_distance_m2), exact, 1e-13 * (1 + exact));
  EXPECT_NEAR(c.barycentric.sum(), 1, 1e-15);
  EXPECT_GE(c.barycentric.minCoeff(), -1e-15);
  Vec3 q = Vec3::Zero();
  for (int k = 0; k < 3; ++k)
    q += c.barycentric(k) * tree.mesh().vertices_m.row(tree.mesh().triangles(c.triangle, k)).transpose();
  EXPECT_LT((q - c.point_m).norm(), 1e-14);
  EXPECT_NEAR((p - q).norm(), exact, 1e-13 * (1 + exact));
}

/// Triangles of all sizes and shapes, needles and points too, in a box that one far triangle makes a thousand times as
/// large.
TriMesh all_sizes(int count, int seed, double far) {
  TriMesh m;
  m.vertices_m.resize(3 * count, 3);
  m.triangles.resize(count, 3);
  std::mt19937 rng(seed);
  std::normal_distribution<double> g;
  std::uniform_real_distribution<double> u;
  const auto any = [&] { return Vec3(g(rng), g(rng), g(rng)); };
  for (Index i = 0; i < count; ++i) {
    const double size = std::exp2(-16 * u(rng)), thinness = i % 2 == 0 ? 1 : std::exp2(-40 * u(rng));
    const Vec3 a = i == 0 ? Vec3(far, far, far) : Vec3(any()), along = size * any();
    m.vertices_m.row(3 * i) = a;
    m.vertices_m.row(3 * i + 1) = a + along;
    m.vertices_m.row(3 * i + 2) = a + u(rng) * along + (i % 11 == 10 ? 0.0 : thinness * size) * any();
    m.triangles.row(i) << 3 * i, 3 * i + 1, 3 * i + 2;
  }
  return m;
}

/// A sheaf of long needles, whose normals floats cannot tell.
TriMesh sheaf(int count) {
  TriMesh m;
  m.vertices_m.resize(3 * count, 3);
  m.triangles.resize(count, 3);
  std::mt19937 rng(7);
  std::normal_distribution<double> g;
  const auto any = [&](double size) { return Vec3(size * g(rng), size * g(rng), size * g(rng)); };
  for (Index i = 0; i < count; ++i) {
    const Vec3 start = any(1e-4), along = Vec3(1, 0.7, 0.4) + any(1e-4);
    m.vertices_m.row(3 * i) = start;
    m.vertices_m.row(3 * i + 1) = start + along;
    m.vertices_m.row(3 * i + 2) = start + 0.9 * along + any(2e-4);
    m.triangles.row(i) << 3 * i, 3 * i + 1, 3 * i + 2;
  }
  return m;
}

class ClosestPointOf : public testing::TestWithParam<TriMesh> {};

TEST_P(ClosestPointOf, equals_brute_force_near_and_far_with_and_without_hint) {
  const TriangleTree tree(GetParam());
  const auto n = static_cast<Index>(tree.mesh().triangles.rows());
  std::mt19937 rng(5);
  std::normal_distribution<double> g;
  std::uniform_int_distribution<Index> pick(0, n - 1);
  Index last = -1;
  for (int i = 0; i < 600; ++i) {
    const double scale = i % 3 == 0 ? 1e-3 : (i % 3 == 1 ? 0.2 : 20.0);
    const Index t = pick(rng);
    Vec3 p = tree.mesh().vertices_m.row(tree.mesh().triangles(t, i % 3)).transpose();
    if (i % 5 != 0) p += scale * Vec3(g(rng), g(rng), g(rng));
    expect_exact(tree, p, -1);
    expect_exact(tree, p, last);
    expect_exact(tree, p, pick(rng));
    const ClosestPoint c = tree.closest(p);
    EXPECT_TRUE(tree.within(p, c.squared_distance_m2, last));
    EXPECT_TRUE(tree.within(p, 1.1 * c.squared_distance_m2 + 1e-30));
    if (c.squared_distance_m2 > 0) {
      EXPECT_FALSE(tree.within(p, 0.999 * c.squared_distance_m2, last));
    }
    const ClosestPoint hinted = tree.closest(p, pick(rng));
    EXPECT_EQ(hinted.triangle, c.triangle);
    EXPECT_EQ(hinted.point_m, c.point_m);
    last = c.triangle;
    if (HasFatalFailure()) return;
  }
}

TEST_P(ClosestPointOf, is_exact_after_a_refit) {
  TriangleTree tree(GetParam());
  Points moved = tree.mesh().vertices_m;
  for (Eigen::Index i = 0; i < moved.rows(); ++i) {
    const Vec3 p = moved.row(i).transpose();
    moved.row(i) += 0.4 * Eigen::RowVector3d(std::sin(3 * p.y()), std::cos(2 * p.z()), std::sin(p.x() + p.y()));
  }
  tree.refit(moved);
  EXPECT_EQ(tree.mesh().vertices_m, moved);
  std::mt19937 rng(9);
  std::normal_distribution<double> g;
  for (int i = 0; i < 200; ++i) expect_exact(tree, Vec3(g(rng), g(rng), g(rng)), -1);
}

// The part that closest points need is refitted by who first asks for one: threads that ask at once get the same answers.
TEST_P(ClosestPointOf, is_the_same_for_threads_that_ask_at_once_after_a_refit) {
  TriMesh moved = GetParam();
  moved.vertices_m *= 1.5;
  const TriangleTree fresh(moved);
  std::mt19937 rng(10);
  std::normal_distribution<double> g;
  std::vector<Vec3> points;
  for (int i = 0; i < 100; ++i) points.push_back(Vec3(g(rng), g(rng), g(rng)));
  for (int round = 0; round < 5; ++round) {
    TriangleTree tree(GetParam());
    tree.refit(moved.vertices_m);
    std::array<int, 4> wrong{};
    std::vector<std::thread> threads;
    for (int& mine : wrong)
      threads.emplace_back([&] {
        for (const Vec3& p : points) mine += tree.closest(p).point_m != fresh.closest(p).point_m;
      });
    for (auto& thread : threads) thread.join();
    EXPECT_EQ(wrong, (std::array<int, 4>{}));
  }
}

TEST_P(ClosestPointOf, first_ray_hit_is_the_nearest_of_all_triangles) {
  const TriMesh& m = GetParam();
  const TriangleTree tree(m);
  std::mt19937 rng(11);
  std::normal_distribution<double> g;
  int hits = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec3 o(2 * g(rng), 2 * g(rng), 2 * g(rng)), target(0.4 * g(rng), 0.4 * g(rng), 0.4 * g(rng));
    const Vec3 d = (i % 4 == 0 ? Vec3(0, 0, o.z() > 0 ? -3 : 3) : Vec3(target - o));
    // Moller and Trumbore in long double over every triangle
    long double nearest = std::numeric_limits<long double>::infinity();
    for (Eigen::Index t = 0; t < m.triangles.rows(); ++t) {
      const auto v = [&](int k) { return Vec3L(m.vertices_m.row(m.triangles(t, k)).transpose().cast<long double>()); };
      const Vec3L e1 = v(1) - v(0), e2 = v(2) - v(0), dl = d.cast<long double>(), h = dl.cross(e2);
      const long double det = e1.dot(h);
      if (det == 0) continue;
      const Vec3L s = o.cast<long double>() - v(0), q = s.cross(e1);
      const long double u = s.dot(h) / det, w = dl.dot(q) / det, range = e2.dot(q) / det;
      if (u >= 0 && w >= 0 && u + w <= 1 && range >= 0) nearest = std::min(nearest, range);
    }
    const auto hit = tree.cast(o, d);
    ASSERT_EQ(hit.has_value(), std::isfinite(nearest)) << "ray " << i;
    if (!hit) continue;
    ++hits;
    EXPECT_NEAR(hit->range_m, static_cast<double>(nearest), 1e-9);
    EXPECT_NEAR(hit->barycentric.sum(), 1, 1e-12);
    EXPECT_FALSE(tree.cast(o, d, 0.999 * hit->range_m));
  }
  EXPECT_GT(hits, 5);
}

INSTANTIATE_TEST_SUITE_P(Shapes, ClosestPointOf,
                         testing::Values(shapes::box(Vec3::Ones()), shapes::sphere(0.8, 3), shapes::torus(0.7, 0.2, 40, 20),
                                         shapes::soup(300, 1), all_sizes(400, 3, 1), all_sizes(400, 4, 1e3),
                                         shapes::make({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}})));

TEST(TriangleTree, rays_along_edges_and_through_corners_do_not_slip_through) {
  const TriangleTree tree(shapes::sphere(1, 3));
  const TriMesh& m = tree.mesh();
  for (Eigen::Index t = 0; t < m.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const Vec3 a = m.vertices_m.row(m.triangles(t, k)).transpose();
      const Vec3 b = m.vertices_m.row(m.triangles(t, (k + 1) % 3)).transpose();
      EXPECT_TRUE(tree.cast(Vec3::Zero(), a));
      EXPECT_TRUE(tree.cast(Vec3::Zero(), 0.5 * (a + b)));
      EXPECT_TRUE(tree.cast(Vec3::Zero(), 0.3 * a + 0.7 * b));
    }
}

TEST(TriangleTree, is_exact_in_a_sheaf_of_needles) {
  const TriangleTree tree(sheaf(1000));
  std::mt19937 rng(3);
  std::normal_distribution<double> g;
  std::uniform_real_distribution<double> u;
  for (int i = 0; i < 3000; ++i) {
    const Vec3 p = u(rng) * Vec3(1, 0.7, 0.4) + std::exp2(-14 * u(rng)) * Vec3(g(rng), g(rng), g(rng));
    // needles cost double up to seven digits
    EXPECT_NEAR(std::sqrt(tree.closest(p).squared_distance_m2), double(std::sqrt(brute_force(tree.mesh(), p))), 5e-9);
  }
}

TEST(TriangleTree, of_triangles_that_are_equally_near_the_first_one_is_named) {
  // above every vertex of a convex surface all triangles around it are equally near
  const TriMesh m = shapes::sphere(1, 3);
  TriangleTree tree(m);
  const auto check = [&](const TriMesh& surface) {
    int ties = 0;
    for (Eigen::Index v = 0; v < surface.vertices_m.rows(); ++v) {
      const Vec3 p = 1.25 * surface.vertices_m.row(v).transpose();
      const ClosestPoint c = tree.closest(p);
      for (Index t = 0; t < surface.triangles.rows(); ++t) {
        if ((surface.triangles.row(t).array() != static_cast<Index>(v)).all()) continue;
        const ClosestPoint other = tree.closest(p, t);
        EXPECT_EQ(other.triangle, c.triangle) << "vertex " << v;
        EXPECT_EQ(other.squared_distance_m2, c.squared_distance_m2);
        const Vec3 corner = surface.vertices_m.row(v).transpose();
        if ((p - corner).squaredNorm() == c.squared_distance_m2) {
          EXPECT_GE(t, c.triangle);
          ties += t > c.triangle;
        }
      }
    }
    EXPECT_GT(ties, 100);
  };
  check(m);
  TriMesh longer = m;
  longer.vertices_m.col(0) *= 1.5;
  tree.refit(longer.vertices_m);
  check(longer);
}

TEST(TriangleTree, copies_at_one_place_and_a_single_point_build) {
  TriMesh m = shapes::make({{1, 2, 3}, {1, 2, 3}, {1, 2, 3}}, {});
  m.triangles.resize(5000, 3);
  m.triangles.rowwise() = Eigen::Matrix<Index, 1, 3>(0, 1, 2);
  const TriangleTree tree(m);
  EXPECT_NEAR(tree.closest(Vec3(1, 2, 5)).squared_distance_m2, 4, 1e-14);
  EXPECT_EQ(tree.closest(Vec3(1, 2, 5), 77).triangle, 0);
  EXPECT_FALSE(tree.cast(Vec3(1, 2, 5), Vec3(0, 0, -1)));
}

TEST(TriangleTree, exponentially_spaced_triangles_build) {
  TriMesh m = shapes::soup(0, 0);
  m.vertices_m.resize(3 * 600, 3);
  m.triangles.resize(600, 3);
  for (Index i = 0; i < 600; ++i) {
    const double s = std::exp2(-i * 0.5);
    m.vertices_m.row(3 * i) << s, 0, 0;
    m.vertices_m.row(3 * i + 1) << 1.1 * s, 0, 0;
    m.vertices_m.row(3 * i + 2) << s, 0.1 * s, 0;
    m.triangles.row(i) << 3 * i, 3 * i + 1, 3 * i + 2;
  }
  const TriangleTree tree(m);
  EXPECT_NEAR(tree.closest(Vec3(0.5, 0.01, 1)).squared_distance_m2, 1, 1e-12);
}

TEST(TriangleTree, a_point_that_is_not_finite_has_no_answer) {
  const TriangleTree tree(shapes::box(Vec3::Ones()));
  EXPECT_EQ(tree.closest(Vec3(0, NAN, 0)).triangle, -1);
  EXPECT_FALSE(tree.cast(Vec3(0, INFINITY, 0), Vec3::UnitX()));
  EXPECT_FALSE(tree.cast(Vec3(0.5, 0.5, 0.5), Vec3::Zero()));
}

TEST(TriangleTree, refuses_what_is_no_surface) {
  using testing::HasSubstr;
  TriMesh m = shapes::box(Vec3::Ones());
  EXPECT_THAT(message_of([] { TriangleTree(TriMesh{}); }), HasSubstr("no triangle"));
  TriMesh out_of_range = m;
  out_of_range.triangles(3, 1) = 8;
  EXPECT_THAT(message_of([&] { TriangleTree{out_of_range}; }), HasSubstr("0..7"));
  TriMesh nan = m;
  nan.vertices_m(2, 0) = NAN;
  EXPECT_THAT(message_of([&] { TriangleTree{nan}; }), HasSubstr("not finite"));
  TriangleTree tree(m);
  EXPECT_THAT(message_of([&] { tree.refit(Points::Zero(3, 3)); }), HasSubstr("3 rows"));
  EXPECT_THAT(message_of([&] { tree.refit(nan.vertices_m); }), HasSubstr("not finite"));
}

}  // namespace
}  // namespace palpate::geometry::triangle_tree_test
