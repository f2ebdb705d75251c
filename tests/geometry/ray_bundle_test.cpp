// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/ray_bundle.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "geometry/shapes.hpp"

namespace palpate::geometry::ray_bundle_test {
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

Points as_rows(const std::vector<Vec3>& directions) {
  Points out(static_cast<Index>(directions.size()), 3);
  for (std::size_t i = 0; i < directions.size(); ++i) out.row(static_cast<Index>(i)) = directions[i].transpose();
  return out;
}

/// What the rays meet, which must be in view.
std::vector<RayHit> met(const std::vector<Vec3>& directions, const TriMesh& m, const Vec3& eye) {
  auto hits = RayBundle(as_rows(directions)).meet(m.vertices_m, m.triangles, eye, Mat3::Identity());
  EXPECT_TRUE(hits.has_value());
  return hits ? std::move(*hits) : std::vector<RayHit>(directions.size());
}

struct Scene {
  TriMesh surface;
  Vec3 eye;
};

class RaysFromAnEye : public testing::TestWithParam<Scene> {
 protected:
  /// The tree's digits. @returns how many rays hit
  int same(const TriangleTree& tree, const std::vector<Vec3>& directions) const {
    const Vec3& eye = GetParam().eye;
    const std::vector<RayHit> hits = met(directions, tree.mesh(), eye);
    int count = 0;
    for (std::size_t i = 0; i < directions.size(); ++i) {
      const auto expected = tree.cast(eye, directions[i]);
      const RayHit& hit = hits[i];
      EXPECT_EQ(hit.triangle >= 0, expected.has_value()) << directions[i].transpose();
      if (hit.triangle < 0 || !expected) continue;
      ++count;
      EXPECT_EQ(hit.range_m, expected->range_m);
      if (hit.triangle == expected->triangle) {
        EXPECT_EQ(hit.barycentric, expected->barycentric);
        continue;
      }
      Vec3 one = Vec3::Zero(), other = Vec3::Zero();  // two that are hit at one range: on what they share
      for (Index k = 0; k < 3; ++k) {
        one += hit.barycentric(k) * corner(tree.mesh(), hit.triangle, k);
        other += expected->barycentric(k) * corner(tree.mesh(), expected->triangle, k);
      }
      EXPECT_LT((one - other).norm(), 1e-14 * (1 + (one - eye).norm()));
    }
    return count;
  }
  /// The direction itself, if a bundle around the surface's middle may hold it.
  void add_if_ahead(std::vector<Vec3>& directions, const Vec3& direction) const {
    const Vec3 ahead = Vec3(GetParam().surface.vertices_m.colwise().mean()) - GetParam().eye;
    if (direction.normalized().dot(ahead.normalized()) > 0.4) directions.push_back(direction);
  }
};

TEST_P(RaysFromAnEye, MeetWhatTheTreeSaysWithTheSameDigits) {
  const auto& [surface, eye] = GetParam();
  const TriangleTree tree(surface);
  std::mt19937 rng(3);
  std::normal_distribution<double> g;
  std::uniform_int_distribution<Index> pick(0, static_cast<Index>(surface.triangles.rows()) - 1);
  const Vec3 middle = surface.vertices_m.colwise().mean();
  const double size = (surface.vertices_m.rowwise() - middle.transpose()).rowwise().norm().maxCoeff();
  std::vector<Vec3> directions;
  for (int i = 0; i < 3000; ++i) {
    const Index t = pick(rng);
    const Vec3 near = corner(surface, t, 0) + 1e-3 * size * Vec3(g(rng), g(rng), g(rng));
    const Vec3 wide = middle + size * Vec3(g(rng), g(rng), g(rng));
    const Vec3 towards = (i % 2 == 0 ? near : wide) - eye;
    add_if_ahead(directions, i % 3 == 0 ? Vec3(towards.normalized()) : towards);
  }
  EXPECT_GT(same(tree, directions), 100);
}

TEST_P(RaysFromAnEye, MeetTheNearestOfAllTriangles) {
  const auto& [surface, eye] = GetParam();
  std::mt19937 rng(4);
  std::normal_distribution<double> g;
  const Vec3 middle = surface.vertices_m.colwise().mean();
  const double size = (surface.vertices_m.rowwise() - middle.transpose()).rowwise().norm().maxCoeff();
  std::vector<Vec3> directions;
  for (int i = 0; i < 400; ++i) add_if_ahead(directions, (middle + 0.4 * size * Vec3(g(rng), g(rng), g(rng)) - eye).normalized());
  const std::vector<RayHit> hits = met(directions, surface, eye);
  int count = 0;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const long double nearest = nearest_of_all(surface, eye, directions[i]);
    ASSERT_EQ(hits[i].triangle >= 0, std::isfinite(nearest)) << "ray " << i;
    if (hits[i].triangle < 0) continue;
    ++count;
    EXPECT_NEAR(hits[i].range_m, static_cast<double>(nearest), 1e-9 * size);
    EXPECT_NEAR(hits[i].barycentric.sum(), 1, 1e-12);
  }
  EXPECT_GT(count, 20);
}

TEST_P(RaysFromAnEye, ThroughCornersAndAlongEdgesMeetWhatTheTreeSays) {
  const auto& [surface, eye] = GetParam();
  const TriangleTree tree(surface);
  std::vector<Vec3> directions;
  for (Index t = 0; t < surface.triangles.rows(); ++t)
    for (Index k = 0; k < 3; ++k) {
      const Vec3 a = corner(surface, t, k), b = corner(surface, t, (k + 1) % 3);
      for (const double at : {0.0, 0.3, 0.5, 1 - 1e-9}) add_if_ahead(directions, (1 - at) * a + at * b - eye);
    }
  same(tree, directions);
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
  std::mt19937 rng(5);
  std::normal_distribution<double> g;
  std::vector<Vec3> directions;
  for (int i = 0; i < 1000; ++i) add_if_ahead(directions, middle + 0.5 * size * Vec3(g(rng), g(rng), g(rng)) - eye);
  EXPECT_GT(same(tree, directions), 30);
}

// A camera that was moved sees what one there would have seen.
TEST_P(RaysFromAnEye, MeetTheSameAfterATurn) {
  const auto& [surface, eye] = GetParam();
  const TriangleTree tree(surface);
  const Mat3 turn = (Eigen::AngleAxisd(0.8, Vec3(1, 2, -1).normalized()) * Eigen::AngleAxisd(-2, Vec3::UnitX())).toRotationMatrix();
  std::mt19937 rng(7);
  std::normal_distribution<double> g;
  const Vec3 middle = surface.vertices_m.colwise().mean();
  const double size = (surface.vertices_m.rowwise() - middle.transpose()).rowwise().norm().maxCoeff();
  std::vector<Vec3> directions;
  for (int i = 0; i < 1000; ++i) add_if_ahead(directions, middle + 0.4 * size * Vec3(g(rng), g(rng), g(rng)) - eye);
  for (Vec3& direction : directions) direction = (turn.transpose() * direction).eval();
  const auto hits = RayBundle(as_rows(directions)).meet(surface.vertices_m, surface.triangles, eye, turn);
  ASSERT_TRUE(hits);
  int count = 0;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const auto expected = tree.cast(eye, turn * directions[i]);
    ASSERT_EQ((*hits)[i].triangle >= 0, expected.has_value());
    if (!expected) continue;
    ++count;
    EXPECT_EQ((*hits)[i].range_m, expected->range_m);
  }
  EXPECT_GT(count, 30);
}

TEST_P(RaysFromAnEye, AreSkippedWhereAsked) {
  const auto& [surface, eye] = GetParam();
  std::mt19937 rng(8);
  std::normal_distribution<double> g;
  const Vec3 middle = surface.vertices_m.colwise().mean();
  const double size = (surface.vertices_m.rowwise() - middle.transpose()).rowwise().norm().maxCoeff();
  std::vector<Vec3> directions;
  for (int i = 0; i < 400; ++i) add_if_ahead(directions, middle + 0.3 * size * Vec3(g(rng), g(rng), g(rng)) - eye);
  std::vector<char> skipped;
  for (std::size_t i = 0; i < directions.size(); ++i) skipped.push_back(i % 3 == 0);
  const std::vector<RayHit> all = met(directions, surface, eye);
  const auto some = RayBundle(as_rows(directions)).meet(surface.vertices_m, surface.triangles, eye, Mat3::Identity(), skipped);
  ASSERT_TRUE(some);
  for (std::size_t i = 0; i < directions.size(); ++i) EXPECT_EQ((*some)[i].triangle, skipped[i] != 0 ? -1 : all[i].triangle);
}

TEST_P(RaysFromAnEye, MeetNothingBesideAndNowhere) {
  const auto& [surface, eye] = GetParam();
  const Vec3 middle = surface.vertices_m.colwise().mean(), ahead = middle - eye;
  const double size = (surface.vertices_m.rowwise() - middle.transpose()).rowwise().norm().maxCoeff();
  const Vec3 aside = 3 * std::min(size, 0.4 * ahead.norm()) * ahead.unitOrthogonal();
  for (const RayHit& hit : met({ahead + aside, ahead - aside, Vec3::Zero(), Vec3(0, NAN, 1), Vec3(INFINITY, 0, 0)}, surface, eye))
    EXPECT_EQ(hit.triangle, -1);
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, RaysFromAnEye,
    testing::Values(Scene{shapes::box(Vec3::Ones()), Vec3(3, 2.5, 4)}, Scene{shapes::box(Vec3::Ones()), Vec3(0.5, 0.5, 3)},
                    Scene{shapes::sphere(0.8, 3), Vec3(1, -2, 0.5)}, Scene{shapes::sphere(0.06, 4), Vec3(0.3, -0.35, 0.5)},
                    Scene{shapes::sphere(0.8, 3), Vec3(0, 0, 1e4)}, Scene{shapes::sphere(1e-4, 2, Vec3(5, 5, 5)), Vec3(5, 5, 6)},
                    Scene{shapes::torus(0.7, 0.2, 40, 20), Vec3(-1, 1, 1.5)}, Scene{shapes::soup(300, 1), Vec3(0, -6, 1)},
                    Scene{all_shapes(400, 3), Vec3(6, 1, -1)},
                    Scene{shapes::make({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}), Vec3(0.2, 0.3, -2)}));

TEST(RayBundle, ClosedSurfacesHaveNoHoles) {
  const TriMesh m = shapes::sphere(1, 3);
  const Vec3 eye(2, 1, 2);
  std::vector<Vec3> directions;
  for (Index t = 0; t < m.triangles.rows(); ++t)
    for (Index k = 0; k < 3; ++k) {
      const Vec3 a = corner(m, t, k), b = corner(m, t, (k + 1) % 3);
      if ((eye - a).dot(a) <= 0.1 || (eye - b).dot(b) <= 0.1) continue;
      for (const double at : {0.0, 0.5, 0.7}) directions.push_back((1 - at) * a + at * b - eye);
    }
  EXPECT_GT(directions.size(), 1500);
  for (const RayHit& hit : met(directions, m, eye)) {
    ASSERT_GE(hit.triangle, 0);
    EXPECT_NEAR(hit.range_m, 1, 1e-12);
  }
}

// Edge-on every direction of the plane holds the whole triangle in a line or less.
TEST(RayBundle, TrianglesSeenEdgeOnAreMetAsTheTreeSays) {
  const TriMesh m = shapes::make({{-1, 0, 0}, {1, 0, 0}, {0, 0, 1}, {0, 0.5, 2}}, {{0, 1, 2}, {0, 1, 3}, {2, 2, 2}});
  const Vec3 eye(0, 0, 5);  // in the plane of the first
  const TriangleTree tree(m);
  std::mt19937 rng(6);
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<Vec3> directions;
  for (int i = 0; i < 500; ++i) directions.push_back(Vec3(u(rng), i % 2 == 0 ? 0 : 0.2 * u(rng), 0) - eye);
  const std::vector<RayHit> hits = met(directions, m, eye);
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const auto expected = tree.cast(eye, directions[i]);
    ASSERT_EQ(hits[i].triangle >= 0, expected.has_value());
    if (expected) {
      EXPECT_EQ(hits[i].range_m, expected->range_m);
    }
  }
}

TEST(RayBundle, OfTrianglesAtOneRangeTheFirstThatFacesTheEyeIsNamed) {
  const TriMesh m = shapes::make({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 2, 1}, {0, 1, 2}, {0, 1, 2}});
  const Vec3 eye(0.2, 0.2, 3), down(0.01, 0.02, -1);
  EXPECT_EQ(met({down}, m, eye)[0].triangle, 1);
}

TEST(RayBundle, SaysWhenTheSurfaceReachesAroundTheEye) {
  TriMesh m = shapes::box(Vec3::Ones());
  const auto in_view = [&](const Vec3& eye) {
    return RayBundle(as_rows({Vec3(0.5, 0.5, 0.5) - eye})).meet(m.vertices_m, m.triangles, eye, Mat3::Identity()).has_value();
  };
  EXPECT_TRUE(in_view(Vec3(0.5, 0.5, 2)));
  EXPECT_FALSE(in_view(Vec3(0.5, 0.5, 0.5)));
  EXPECT_FALSE(in_view(Vec3(0.4, 0.5, 0.6)));
  EXPECT_FALSE(in_view(Vec3(0, 0, 0)));
  EXPECT_FALSE(in_view(Vec3(0.5, 0.5, 1.01)));
  EXPECT_FALSE(in_view(Vec3(NAN, 0, 0)));
  m.vertices_m(3, 1) = INFINITY;
  EXPECT_FALSE(in_view(Vec3(0.5, 0.5, 2)));
}

TEST(RayBundle, SaysWhenRaysReachAroundTheEye) {
  const TriMesh m = shapes::box(Vec3::Ones());
  const auto in_view = [&](const std::vector<Vec3>& directions) {
    return RayBundle(as_rows(directions)).meet(m.vertices_m, m.triangles, Vec3(0.5, 0.5, 3), Mat3::Identity()).has_value();
  };
  EXPECT_TRUE(in_view({Vec3(0, 0, -1), Vec3(0, 0, -1)}));
  EXPECT_FALSE(in_view({Vec3(0, 0, -1), Vec3(0, 0, -1), Vec3(0, 0, 1)}));
  EXPECT_FALSE(in_view({Vec3(1, 0, 0), Vec3(-1, 0, 0)}));
  EXPECT_FALSE(in_view({}));
  EXPECT_FALSE(in_view({Vec3::Zero()}));
}

// Many triangles on few rays, few on many, and all of a picture in one column.
TEST(RayBundle, AnyNumberOfRaysMeetsWhatTheTreeSays) {
  const Vec3 eye(0.3, -0.35, 0.5);
  for (const int level : {1, 4})
    for (const int count : {1, 7, 20000})
      for (const double across : {0.1, 0.0}) {
        const TriMesh m = shapes::sphere(0.06, level);
        const TriangleTree tree(m);
        std::mt19937 rng(9);
        std::uniform_real_distribution<double> u(-1, 1);
        std::vector<Vec3> directions;
        for (int i = 0; i < count; ++i) directions.push_back(Vec3(across * u(rng), 0, 0.1 * u(rng)) - eye);
        const std::vector<RayHit> hits = met(directions, m, eye);
        for (std::size_t i = 0; i < directions.size(); ++i) {
          const auto expected = tree.cast(eye, directions[i]);
          ASSERT_EQ(hits[i].triangle, expected ? expected->triangle : -1);
          if (expected) {
            ASSERT_EQ(hits[i].range_m, expected->range_m);
          }
        }
      }
}

}  // namespace
}  // namespace palpate::geometry::ray_bundle_test
