// label: statistics
// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/fuse_views.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/geometry/surface_distance.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/reconstruction/build_object.hpp"
#include "palpate/registration/icp.hpp"

namespace palpate::reconstruction::fuse_views_test {
namespace {

TriMesh lump() {
  TriMesh m = shapes::sphere(1, 5);
  for (Index i = 0; i < m.vertices_m.rows(); ++i) {
    const Vec3 d = m.vertices_m.row(i).transpose();
    const double r = 0.09 * (1 + 0.2 * std::sin(3 * d.x() + 1) * std::cos(2 * d.y()) + 0.1 * std::sin(4 * d.z() + d.x()));
    m.vertices_m.row(i) = (r * d).transpose();
  }
  return m;
}

/// What a depth camera at 0.45 m with a focal length of 525 pixels sees in every second row and column from a direction;
/// noise along the ray.
PointCloud view(const geometry::TriangleTree& tree, const Vec3& from, double sigma, std::mt19937& rng) {
  std::normal_distribution<double> g(0, sigma);
  const Vec3 eye = 0.45 * from.normalized(), u = eye.unitOrthogonal(), v = eye.normalized().cross(u);
  std::vector<Vec3> points, normals;
  const TriMesh& m = tree.mesh();
  for (int y = -180; y <= 180; y += 2)
    for (int x = -180; x <= 180; x += 2) {
      const Vec3 d = (-eye.normalized() + x / 525.0 * u + y / 525.0 * v).normalized();
      const auto hit = tree.cast(eye, d);
      if (!hit) continue;
      const auto corner = [&](int k) { return Vec3(m.vertices_m.row(m.triangles(hit->triangle, k)).transpose()); };
      const Vec3 n = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
      if (-n.dot(d) < 0.25) continue;
      points.push_back(eye + (hit->range_m + g(rng)) * d);
      normals.push_back((n + 0.1 * Vec3(g(rng), g(rng), g(rng)) / std::max(sigma, 1e-9)).normalized());
    }
  PointCloud c;
  c.points_m.resize(static_cast<Index>(points.size()), 3);
  c.normals.resize(static_cast<Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i)
    c.points_m.row(i) = points[i].transpose(), c.normals.row(i) = normals[i].transpose();
  c.sigma_m = VectorX::Constant(1, sigma);
  return c;
}

TEST(FuseViews, eight_noisy_views_become_a_watertight_surface) {
  const geometry::TriangleTree tree(lump());
  std::mt19937 rng(1);
  std::vector<PointCloud> clouds;
  for (int k = 0; k < 8; ++k)
    clouds.push_back(view(tree, Vec3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 0.8 : -0.8), 0.0012, rng));
  BuildOptions o;
  o.mesh.tetrahedra = 12000;
  const auto built = build_object(clouds, {}, {}, o);
  EXPECT_TRUE(geometry::check_surface(built.model.surface).watertight());
  const auto d = geometry::surface_distance(tree.mesh(), built.model.surface);
  RecordProperty("rms_um", static_cast<int>(1e6 * d.rms_m));
  EXPECT_LT(d.rms_m, 0.00025);
  EXPECT_LT(built.model.unseen_share, 0.02);
  const double truth = *geometry::check_surface(tree.mesh()).volume_m3;
  EXPECT_NEAR(built.check.volume_m3, truth, 0.01 * truth);
}

TEST(FuseViews, views_from_poses_that_are_a_little_wrong_close_up) {
  const geometry::TriangleTree tree(lump());
  std::mt19937 rng(5);
  std::normal_distribution<double> g;
  std::vector<PointCloud> clouds;
  for (int k = 0; k < 4; ++k) {
    // around the object and from above and below, so that neighbours overlap
    PointCloud c = view(tree, Vec3(std::cos(1.57 * k), std::sin(1.57 * k), k % 2 ? 0.6 : -0.6), 0.0012, rng);
    const Vec3 turn = 0.006 * Vec3(g(rng), g(rng), g(rng)), shift = 0.002 * Vec3(g(rng), g(rng), g(rng));
    const Mat3 r = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    c.points_m = ((c.points_m * r.transpose()).rowwise() + shift.transpose()).eval();
    c.normals = (c.normals * r.transpose()).eval();
    c.pose_std_m = 0.002, c.pose_std_rad = 0.006;
    clouds.push_back(c);
  }
  BuildOptions o;
  o.mesh.tetrahedra = 8000;
  const auto whole = [&](const BuiltObject& b) {  // against the truth, wherever it may stand as a whole
    PointCloud c;
    c.points_m = b.model.surface.vertices_m;
    const Pose T = registration::align(c, tree, Pose::Identity()).T_surface_cloud;
    TriMesh s = b.model.surface;
    s.vertices_m = (s.vertices_m * T.linear().transpose()).rowwise() + T.translation().transpose();
    return geometry::surface_distance(tree.mesh(), s).rms_m;
  };
  const auto aligned = build_object(clouds, {}, {}, o);
  o.align_views = false;
  const double before = whole(build_object(clouds, {}, {}, o)), after = whole(aligned);
  RecordProperty("before_um", static_cast<int>(1e6 * before));
  RecordProperty("after_um", static_cast<int>(1e6 * after));
  EXPECT_LT(after, 0.0004);
  EXPECT_LT(after, 0.5 * before);
  ASSERT_EQ(aligned.view_correction.size(), 4U);
  EXPECT_EQ(aligned.of_surface.sigma_m.size(), aligned.model.surface.vertices_m.rows());
  EXPECT_LT(aligned.of_surface.sigma_m.minCoeff(), 0.0005);
}

TEST(FuseViews, one_view_from_above_is_completed_down_to_the_table) {
  TriMesh m = shapes::sphere(0.05, 5, Vec3(0, 0, 0.05));
  const geometry::TriangleTree tree(m);
  std::mt19937 rng(2);
  FuseOptions fuse;
  fuse.support = Plane{Vec3::Zero(), Vec3::UnitZ()};
  BuildOptions o;
  o.mesh.tetrahedra = 2500;
  const auto built = build_object({view(tree, Vec3(0.01, 0, 1), 0.0005, rng)}, fuse, {}, o);
  EXPECT_GT(built.model.unseen_share, 0.2);
  EXPECT_THAT(built.model.warnings, testing::Contains(testing::HasSubstr("not seen")));
  const double ball = 4.0 / 3 * M_PI * std::pow(0.05, 3);
  EXPECT_GT(built.check.volume_m3, ball);         // the cylinder below the equator is filled
  EXPECT_LT(built.check.volume_m3, 1.35 * ball);  // half a ball and that cylinder: 1.25
  EXPECT_NEAR(built.check.min_m.z(), 0, 0.003);
  // the top was seen and is known to a fraction of the noise, the foot of the invented flank is known to a centimetre or two
  const Points& v = built.model.surface.vertices_m;
  for (Index i = 0; i < v.rows(); ++i) {
    if (v(i, 2) > 0.08) {
      EXPECT_TRUE(built.of_surface.seen[i]);
      EXPECT_LT(built.of_surface.sigma_m[i], 0.0005);
    }
    if (v(i, 2) < 0.01 && v.row(i).head<2>().norm() > 0.045) {
      EXPECT_FALSE(built.of_surface.seen[i]);
      EXPECT_GT(built.of_surface.sigma_m[i], 0.01);
      EXPECT_LT(built.of_surface.sigma_m[i], 0.04);
    }
  }
}

TEST(FuseViews, what_floats_beside_the_object_is_left_out_and_said) {
  const geometry::TriangleTree tree(shapes::join(shapes::sphere(0.05, 4), shapes::sphere(0.02, 4, Vec3(0.1, 0, 0.01))));
  std::mt19937 rng(3);
  std::vector<PointCloud> clouds;
  for (int k = 0; k < 8; ++k)
    clouds.push_back(view(tree, Vec3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 0.8 : -0.8), 0.0005, rng));
  BuildOptions o;
  o.mesh.tetrahedra = 3000;
  const auto built = build_object(clouds, {}, {}, o);
  EXPECT_EQ(built.check.components, 1);
  EXPECT_NEAR(built.check.volume_m3, 4.0 / 3 * M_PI * std::pow(0.05, 3), 2e-5);
  EXPECT_THAT(built.model.warnings, testing::Contains(testing::HasSubstr("floats")));
}

TEST(FuseViews, says_what_is_missing) {
  PointCloud c;
  c.points_m = Points::Random(100, 3);
  EXPECT_THROW(fuse_views({c}), Error);  // no normals
  EXPECT_THROW(fuse_views({}), Error);
  FuseOptions o;
  o.cell_m = -1;
  EXPECT_THROW(fuse_views({c}, o), Error);
  o = {};
  o.fewest_points = 0;
  EXPECT_THROW(fuse_views({c}, o), Error);
  o = {};
  o.support = Plane{Vec3::Zero(), Vec3(0, 0, 2)};
  EXPECT_THROW(fuse_views({c}, o), Error);
}

}  // namespace
}  // namespace palpate::reconstruction::fuse_views_test
