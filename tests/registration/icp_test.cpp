// label: statistics
// SPDX-License-Identifier: Apache-2.0
#include "palpate/registration/icp.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"

namespace palpate::registration::icp_test {
namespace {

/// A closed surface without symmetry, about 0.2 m.
TriMesh lump() {
  TriMesh m = shapes::sphere(1, 4);
  for (Index i = 0; i < m.vertices_m.rows(); ++i) {
    const Vec3 d = m.vertices_m.row(i).transpose();
    const double r = 0.1 * (1 + 0.25 * std::sin(3 * d.x() + 1) * std::cos(2 * d.y()) + 0.15 * std::sin(4 * d.z() + d.x()));
    m.vertices_m.row(i) = (r * d).transpose();
  }
  return m;
}

struct View {
  PointCloud cloud;
  Points normals;
};

/// What a camera on the z axis sees: points spread over the half that faces it, with noise along the normal.
View view(const TriMesh& m, int count, double sigma, std::uint32_t seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u;
  std::normal_distribution<double> g;
  std::vector<std::pair<Index, double>> front;
  double area = 0;
  const auto corner = [&](Index t, int k) { return Vec3(m.vertices_m.row(m.triangles(t, k)).transpose()); };
  for (Index t = 0; t < m.triangles.rows(); ++t) {
    const Vec3 n = (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
    if (n.z() > 0.2 * n.norm()) front.emplace_back(t, area += n.norm());
  }
  View out;
  out.cloud.points_m.resize(count, 3);
  out.normals.resize(count, 3);
  out.cloud.sigma_m = VectorX::Constant(1, sigma);
  for (int i = 0; i < count; ++i) {
    const double at = u(rng) * area;
    const auto it = std::lower_bound(front.begin(), front.end(), at, [](const auto& f, double a) { return f.second < a; });
    double a = u(rng), b = u(rng);
    if (a + b > 1) a = 1 - a, b = 1 - b;
    const Vec3 n =
        (corner(it->first, 1) - corner(it->first, 0)).cross(corner(it->first, 2) - corner(it->first, 0)).normalized();
    const Vec3 p = (1 - a - b) * corner(it->first, 0) + a * corner(it->first, 1) + b * corner(it->first, 2);
    out.cloud.points_m.row(i) = (p + sigma * g(rng) * n).transpose();
    out.normals.row(i) = n.transpose();
  }
  return out;
}

Pose offset(double angle_rad, double shift_m, std::mt19937& rng) {
  std::normal_distribution<double> g;
  const Vec3 axis = Vec3(g(rng), g(rng), g(rng)).normalized(), shift = shift_m * Vec3(g(rng), g(rng), g(rng)).normalized();
  return Pose(Eigen::Translation3d(shift) * Eigen::AngleAxisd(angle_rad, axis));
}

/// (rotation vector, translation) of a pose near the identity.
Eigen::Matrix<double, 6, 1> as_vector(const Pose& T) {
  const Eigen::AngleAxisd a(T.linear());
  Eigen::Matrix<double, 6, 1> v;
  v << a.angle() * a.axis(), T.translation();
  return v;
}

TEST(Icp, without_noise_both_metrics_find_the_pose) {
  const geometry::TriangleTree tree(lump());
  std::mt19937 rng(1);
  for (const IcpMetric metric : {IcpMetric::point_to_plane, IcpMetric::point_to_point}) {
    IcpOptions o;
    o.metric = metric;
    o.max_iterations = metric == IcpMetric::point_to_plane ? 50 : 300;
    o.stop_share = 1e-6;
    const auto r = align(view(tree.mesh(), 2000, 0, 3).cloud, tree, offset(0.09, 0.01, rng), o);
    EXPECT_TRUE(r.converged || metric == IcpMetric::point_to_point) << r.reason;
    EXPECT_EQ(r.open_directions, 0);
    const double loose = metric == IcpMetric::point_to_plane ? 1e-9 : 1e-3;
    EXPECT_LT(as_vector(r.T_surface_cloud).norm(), loose);
    if (metric == IcpMetric::point_to_plane) {
      EXPECT_LE(r.iterations, 14);
    }
  }
}

TEST(Icp, error_reaches_the_cramer_rao_bound_and_the_covariance_tells_it) {
  const geometry::TriangleTree tree(lump());
  constexpr double sigma = 0.0012;
  constexpr int seeds = 50;
  std::mt19937 rng(2);
  std::vector<double> ratio;
  double normalised = 0;
  Matrix6 spread = Matrix6::Zero(), told = Matrix6::Zero();
  for (int s = 0; s < seeds; ++s) {
    const View v = view(tree.mesh(), 4000, sigma, 100 + s);
    const auto r = align(v.cloud, tree, offset(0.09, 0.01, rng));
    ASSERT_TRUE(r.converged) << r.reason;
    // the bound: true correspondences and normals
    Matrix6 h = Matrix6::Zero();
    for (Index i = 0; i < v.normals.rows(); ++i) {
      const Vec3 p = v.cloud.points_m.row(i).transpose(), n = v.normals.row(i).transpose();
      Eigen::Matrix<double, 6, 1> j;
      j << p.cross(n), n;
      h += j * j.transpose() / (sigma * sigma);
    }
    const auto d = as_vector(r.T_surface_cloud);
    ratio.push_back(std::sqrt(d.dot(h * d) / 6));
    normalised += d.dot(r.covariance.ldlt().solve(d)) / seeds;
    spread += d * d.transpose() / seeds;
    told += r.covariance / seeds;
  }
  std::sort(ratio.begin(), ratio.end());
  EXPECT_LT(ratio[seeds / 2], 1.1);
  EXPECT_LT(ratio.back(), 3);
  // chi square with 6 degrees, mean of 50: 6 +- 0.49
  EXPECT_GT(normalised, 4.5);
  EXPECT_LT(normalised, 7.5);
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(std::sqrt(told(k, k) / spread(k, k)), 1, 0.3) << k;
}

TEST(Icp, outliers_are_trimmed_or_down_weighted) {
  const geometry::TriangleTree tree(lump());
  PointCloud cloud = view(tree.mesh(), 3000, 0.0005, 5).cloud;
  for (Index i = 0; i < 600; ++i) cloud.points_m.row(i) += Eigen::RowVector3d(0.004, 0.006, 0.012);
  std::mt19937 rng(4);
  const Pose start = offset(0.05, 0.005, rng);
  const double plain = as_vector(align(cloud, tree, start).T_surface_cloud).norm();
  IcpOptions trimmed, tukey;
  trimmed.trim = 0.7;
  tukey.tukey = 4.7;
  const double with_trim = as_vector(align(cloud, tree, start, trimmed).T_surface_cloud).norm();
  const double with_tukey = as_vector(align(cloud, tree, start, tukey).T_surface_cloud).norm();
  EXPECT_LT(with_trim, 0.5 * plain);
  EXPECT_LT(with_tukey, 0.25 * plain);
}

TEST(Icp, pairs_along_rays_are_not_biased_by_noise_that_exceeds_the_roughness) {
  // ripples of 0.4 mm under noise of 1.2 mm: closest points are drawn to the crests
  TriMesh m = shapes::sphere(1, 6);
  for (Index i = 0; i < m.vertices_m.rows(); ++i) {
    const Vec3 d = m.vertices_m.row(i).transpose();
    const double r = 0.1 * (1 + 0.25 * std::sin(3 * d.x() + 1) * std::cos(2 * d.y()) + 0.15 * std::sin(4 * d.z() + d.x()));
    m.vertices_m.row(i) = ((r + 0.0004 * std::sin(90 * d.x()) * std::sin(90 * d.y())) * d).transpose();
  }
  const geometry::TriangleTree tree(m);
  const Vec3 eye(0.05, -0.1, 0.5);
  constexpr double sigma = 0.0012;
  constexpr int seeds = 12;
  std::vector<double> ratio;
  double normalised = 0;
  for (int s = 0; s < seeds; ++s) {
    std::mt19937 rng(300 + s);
    std::normal_distribution<double> g;
    std::vector<Vec3> points;
    Matrix6 h = Matrix6::Zero();
    for (int y = -60; y <= 60; ++y)
      for (int x = -60; x <= 60; ++x) {
        const Vec3 d = (Vec3(0.0033 * x, 0.0033 * y, 0) - eye).normalized();
        const auto hit = tree.cast(eye, d);
        if (!hit) continue;
        const auto corner = [&](int k) { return Vec3(m.vertices_m.row(m.triangles(hit->triangle, k)).transpose()); };
        const Vec3 n = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
        if (-n.dot(d) < 0.3) continue;
        points.push_back(eye + (hit->range_m + sigma * g(rng)) * d);
        Eigen::Matrix<double, 6, 1> j;  // of the range, in units of its noise
        j << points.back().cross(n), n;
        h += j * j.transpose() / std::pow(sigma * n.dot(d), 2);
      }
    PointCloud cloud;
    cloud.points_m.resize(static_cast<Index>(points.size()), 3);
    for (std::size_t i = 0; i < points.size(); ++i) cloud.points_m.row(static_cast<Index>(i)) = points[i].transpose();
    cloud.sigma_m = VectorX::Constant(1, sigma);
    IcpOptions o;
    o.sensor_m = eye;
    const auto r = align(cloud, tree, offset(0.03, 0.004, rng), o);
    ASSERT_TRUE(r.converged) << r.reason;
    const auto d = as_vector(r.T_surface_cloud);
    ratio.push_back(std::sqrt(d.dot(h * d) / 6));
    normalised += d.dot(r.covariance.ldlt().solve(d)) / (6 * seeds);
  }
  std::sort(ratio.begin(), ratio.end());
  EXPECT_LT(ratio[seeds / 2], 1.25);
  EXPECT_LT(ratio.back(), 3);
  EXPECT_GT(normalised, 0.5);
  EXPECT_LT(normalised, 1.7);
}

TEST(Icp, tells_along_which_directions_it_may_slide) {
  const geometry::TriangleTree plane(shapes::make({{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}));
  PointCloud cloud;
  cloud.points_m = Points::Random(500, 3) * 0.1;
  cloud.points_m.col(2).setConstant(0.004);
  const auto r = align(cloud, plane, Pose::Identity());
  EXPECT_EQ(r.open_directions, 3);
  EXPECT_NEAR(r.T_surface_cloud.translation().z(), -0.004, 1e-9);
  EXPECT_NEAR(r.T_surface_cloud.translation().head<2>().norm(), 0, 1e-9);
}

TEST(Icp, far_away_it_says_so_instead_of_returning_a_pose_as_good) {
  const geometry::TriangleTree tree(lump());
  const auto r = align(view(tree.mesh(), 500, 0, 3).cloud, tree, Pose(Eigen::Translation3d(1, 0, 0)));
  EXPECT_FALSE(r.converged);
  EXPECT_THAT(r.reason, testing::HasSubstr("start pose"));
}

TEST(Icp, options_and_clouds_are_checked) {
  const geometry::TriangleTree tree(lump());
  const PointCloud cloud = view(tree.mesh(), 50, 0, 3).cloud;
  const auto bad = [&](auto change) {
    IcpOptions o;
    change(o);
    EXPECT_THROW(align(cloud, tree, Pose::Identity(), o), Error);
  };
  bad([](auto& o) { o.reject_m = 0; });
  bad([](auto& o) { o.trim = 0; });
  bad([](auto& o) { o.tukey = 1; });
  bad([](auto& o) { o.reject_angle_rad = 0; });
  bad([](auto& o) { o.max_iterations = 0; });
  bad([](auto& o) { o.stop_share = 0; });
  PointCloud few;
  few.points_m = Points::Zero(3, 3);
  EXPECT_THROW(align(few, tree, Pose::Identity()), Error);
  PointCloud negative = cloud;
  negative.sigma_m = VectorX::Constant(50, -1);
  EXPECT_THROW(align(negative, tree, Pose::Identity()), Error);
}

}  // namespace
}  // namespace palpate::registration::icp_test
