// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/registration/views.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"

namespace palpate::registration::views_test {
namespace {

constexpr double sigma_m = 0.001;

/// A closed surface without symmetry, about 0.2 m, in closed form: points and normals know nothing of triangles.
Vec3 lump(const Vec3& direction) {
  const Vec3 d = direction.normalized();
  return 0.1 * (1 + 0.25 * std::sin(3 * d.x() + 1) * std::cos(2 * d.y()) + 0.15 * std::sin(4 * d.z() + d.x())) * d;
}

Vec3 lump_normal(const Vec3& direction) {
  const Vec3 d = direction.normalized(), u = d.unitOrthogonal(), v = d.cross(u);
  return (lump(d + 1e-5 * u) - lump(d - 1e-5 * u)).cross(lump(d + 1e-5 * v) - lump(d - 1e-5 * v)).normalized();
}

/// What is seen from one side, with noise along the normal.
PointCloud view(const Vec3& from, int count, std::mt19937& rng) {
  std::normal_distribution<double> g;
  PointCloud c;
  c.points_m.resize(count, 3);
  c.normals.resize(count, 3);
  for (int i = 0; i < count;) {
    const Vec3 d = Vec3(g(rng), g(rng), g(rng)).normalized(), n = lump_normal(d);
    if (n.dot(from.normalized()) < 0.15) continue;
    c.points_m.row(i) = (lump(d) + sigma_m * g(rng) * n).transpose();
    c.normals.row(i++) = (n + 0.05 * Vec3(g(rng), g(rng), g(rng))).normalized().transpose();
  }
  c.sigma_m = VectorX::Constant(1, sigma_m);
  return c;
}

Pose wrong(double angle_rad, double shift_m, std::mt19937& rng) {
  std::normal_distribution<double> g;
  const Vec3 turn = angle_rad * Vec3(g(rng), g(rng), g(rng)), shift = shift_m * Vec3(g(rng), g(rng), g(rng));
  return Pose(Eigen::Translation3d(shift) * Eigen::AngleAxisd(turn.norm(), turn.normalized()));
}

void apply(const Pose& T, PointCloud& c) {
  c.points_m = ((c.points_m * T.linear().transpose()).rowwise() + T.translation().transpose()).eval();
  c.normals = (c.normals * T.linear().transpose()).eval();
}

std::vector<PointCloud> ring_of_views(int views, int points, std::mt19937& rng) {
  std::vector<PointCloud> out;
  for (int k = 0; k < views; ++k) {
    const double a = 2 * M_PI * k / views;
    out.push_back(view(Vec3(std::cos(a), std::sin(a), k % 2 ? 0.5 : -0.5), points, rng));
  }
  return out;
}

TEST(AlignViews, a_ring_of_views_closes_up_against_the_held_first_one) {
  std::mt19937 rng(3);
  auto clouds = ring_of_views(4, 6000, rng);
  std::vector<Pose> moved(4, Pose::Identity());
  for (int k = 1; k < 4; ++k) apply(moved[k] = wrong(0.02, 0.004, rng), clouds[k]);
  const auto r = align_views(clouds);
  EXPECT_TRUE(r.converged) << r.reason;
  EXPECT_TRUE(r.correction[0].isApprox(Pose::Identity(), 1e-6));
  for (int k = 1; k < 4; ++k) {
    const Pose left = r.correction[k] * moved[k];
    EXPECT_LT(left.translation().norm(), 0.0006) << k;
    EXPECT_LT(Eigen::AngleAxisd(left.linear()).angle(), 0.006) << k;
  }
}

TEST(AlignViews, covariance_is_what_repeating_shows) {
  constexpr int seeds = 24, views = 4;
  double normalised = 0;
  for (int s = 0; s < seeds; ++s) {
    std::mt19937 rng(40 + s);
    auto clouds = ring_of_views(views, 2500, rng);
    VectorX error(6 * views);
    std::vector<Pose> moved;
    for (auto& c : clouds) {
      moved.push_back(wrong(0.01, 0.002, rng));
      apply(moved.back(), c);
      c.pose_std_rad = 0.01, c.pose_std_m = 0.002;
    }
    const auto r = align_views(clouds);
    ASSERT_TRUE(r.converged) << r.reason;
    for (int k = 0; k < views; ++k) {
      const Pose left = r.correction[k] * moved[k];
      const Eigen::AngleAxisd turn(left.linear());
      error.segment<3>(6 * k) = turn.angle() * turn.axis();
      error.segment<3>(6 * k + 3) = left * r.centre_m[k] - r.centre_m[k];
    }
    normalised += error.dot(r.covariance.ldlt().solve(error)) / (6 * views * seeds);
  }
  // mean of chi square over its degrees; pairs share points, so that one is only roughly met
  EXPECT_GT(normalised, 0.5);
  EXPECT_LT(normalised, 1.8);
}

TEST(AlignViews, a_view_that_sees_another_thing_is_named) {
  std::mt19937 rng(5);
  auto clouds = ring_of_views(3, 3000, rng);
  apply(Pose(Eigen::Translation3d(1, 0, 0)), clouds[2]);
  const auto r = align_views(clouds);
  EXPECT_FALSE(r.converged);
  EXPECT_THAT(r.alone, testing::ElementsAre(2));
}

TEST(AlignViews, options_and_clouds_are_checked) {
  std::mt19937 rng(5);
  auto clouds = ring_of_views(2, 500, rng);
  const auto bad = [&](auto change) {
    ViewsOptions o;
    change(o);
    EXPECT_THROW(align_views(clouds, o), Error);
  };
  bad([](auto& o) { o.cell_m = -1; });
  bad([](auto& o) { o.reject_m = NAN; });
  bad([](auto& o) { o.reject_angle_rad = 0; });
  bad([](auto& o) { o.max_iterations = 0; });
  EXPECT_THROW(align_views({clouds[0]}), Error);
  clouds[1].normals.resize(0, 3);
  EXPECT_THROW(align_views(clouds), Error);
}

}  // namespace
}  // namespace palpate::registration::views_test
