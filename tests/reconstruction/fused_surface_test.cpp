// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/fused_surface.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/geometry/embedding.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/reconstruction/build_object.hpp"
#include "palpate/reconstruction/unseen_patches.hpp"

namespace palpate::reconstruction::fused_surface_test {
namespace {

/// Points of a ball with normals, evenly spread; noise along the normals. Those with `z` above the limit only.
PointCloud ball(double radius, const Vec3& centre, int count, double sigma, double above = -1) {
  std::mt19937 rng(3);
  std::normal_distribution<double> g;
  PointCloud c;
  c.points_m.resize(count, 3);
  c.normals.resize(count, 3);
  for (int i = 0; i < count; ++i) {
    const double z = above + (1 - above) * (i + 0.5) / count, turn = 2.399963 * i, r = std::sqrt(1 - z * z);
    const Vec3 n(r * std::cos(turn), r * std::sin(turn), z);
    c.points_m.row(i) = (centre + (radius + sigma * g(rng)) * n).transpose();
    c.normals.row(i) = n.transpose();
  }
  c.sigma_m = VectorX::Constant(1, sigma);
  return c;
}

/// Largest and root-mean-square distance of the vertices from the ball.
std::pair<double, double> off_ball(const TriMesh& m, double radius) {
  const Eigen::ArrayXd d = m.vertices_m.rowwise().norm().array() - radius;
  return {d.abs().maxCoeff(), std::sqrt(d.square().mean())};
}

TEST(FusedSurface, of_a_ball_is_watertight_and_does_not_bulge) {
  constexpr double radius = 0.05;
  FuseOptions o;
  o.cell_m = 0.006;  // wide for the curvature: means of planes alone would lie 0.1 mm too far out
  const FusedViews fused = fuse_views({ball(radius, Vec3::Zero(), 40000, 0)}, o);
  const TriMesh m = fused_surface(fused);
  const auto check = geometry::check_surface(m);
  EXPECT_TRUE(check.watertight());
  EXPECT_EQ(check.components, 1);
  EXPECT_EQ(check.pinched_vertices, 0);
  ASSERT_TRUE(check.volume_m3);
  EXPECT_GT(*check.volume_m3, 0);
  EXPECT_LT(off_ball(m, radius).second, 5e-5);
  const double mean = m.vertices_m.rowwise().norm().mean() - radius;
  EXPECT_LT(std::abs(mean), 3e-5);
}

TEST(FusedSurface, averages_noise_and_closes_what_nobody_saw) {
  constexpr double radius = 0.06, sigma = 0.0012;
  const FusedViews fused = fuse_views({ball(radius, Vec3::Zero(), 40000, sigma, -0.9)});  // a hole of 25 degrees below
  const TriMesh m = fused_surface(fused);
  EXPECT_TRUE(geometry::check_surface(m).watertight());
  double seen = 0;
  Index count = 0;
  for (Index v = 0; v < m.vertices_m.rows(); ++v)
    if (m.vertices_m(v, 2) > -0.8 * radius) seen += std::pow(m.vertices_m.row(v).norm() - radius, 2), ++count;
  EXPECT_LT(std::sqrt(seen / count), 0.22 * sigma);
  EXPECT_LT(off_ball(m, radius).first, 0.06 * radius);  // a flat lid would lie a tenth too high
}

TEST(FusedSurface, goes_on_without_a_bend_where_nobody_saw_it) {
  constexpr double radius = 0.06;
  for (const double above : {-0.9, -0.75}) {  // holes of 26 and 41 degrees: flat lids would lie 0.1 and 0.25 of the radius too high
    const FusedViews fused = fuse_views({ball(radius, Vec3::Zero(), 40000, 0.0002, above)});
    const TriMesh m = fused_surface(fused);
    EXPECT_TRUE(geometry::check_surface(m).watertight());
    EXPECT_LT(off_ball(m, radius).first, 0.3 * (1 + above) * radius) << above;
  }
}

TEST(FusedSurface, follows_a_groove_whose_floor_nobody_saw) {
  // two balls that overlap, the ring where they meet out of sight
  constexpr double radius = 0.05, apart = 0.035, seen_beyond = 0.014;
  PointCloud cloud;
  for (const double sign : {1.0, -1.0}) {
    const PointCloud whole = ball(radius, Vec3(0, 0, sign * apart), 40000, 0.0002);
    std::vector<Index> seen;
    for (Index i = 0; i < whole.points_m.rows(); ++i)
      if (sign * whole.points_m(i, 2) > seen_beyond) seen.push_back(i);
    const Index before = static_cast<Index>(cloud.points_m.rows()), count = static_cast<Index>(seen.size());
    cloud.points_m.conservativeResize(before + count, 3), cloud.normals.conservativeResize(before + count, 3);
    cloud.points_m.bottomRows(count) = whole.points_m(seen, Eigen::all);
    cloud.normals.bottomRows(count) = whole.normals(seen, Eigen::all);
  }
  cloud.sigma_m = VectorX::Constant(1, 0.0002);
  const TriMesh m = fused_surface(fuse_views({cloud}));
  double narrowest = 1;
  for (Index v = 0; v < m.vertices_m.rows(); ++v)
    if (std::abs(m.vertices_m(v, 2)) < 0.002) narrowest = std::min(narrowest, m.vertices_m.row(v).head<2>().norm());
  const double rim = std::sqrt(radius * radius - std::pow(apart - seen_beyond, 2)), floor = std::sqrt(radius * radius - apart * apart);
  EXPECT_LT(narrowest, rim - 0.3 * (rim - floor));
  EXPECT_GT(narrowest, 0.9 * floor);
}

TEST(UnseenPatches, leave_alone_what_no_facet_holds) {
  constexpr double radius = 0.05, apart = 0.2;
  const TriMesh one = shapes::sphere(radius, 3);
  const Index n = static_cast<Index>(one.vertices_m.rows());
  TriMesh two = one;
  two.vertices_m.conservativeResize(2 * n, 3), two.triangles.conservativeResize(2 * one.triangles.rows(), 3);
  two.vertices_m.bottomRows(n) = one.vertices_m.rowwise() + Vec3(apart, 0, 0).transpose();
  two.triangles.bottomRows(one.triangles.rows()) = one.triangles.array() + n;
  const TriMesh before = two;
  const Grid facets({ball(radius, Vec3::Zero(), 4000, 0, -0.8)}, 0.01);  // of the first one, all but a cap
  smooth_unseen_patches(two, facets, 0.005, {});
  EXPECT_EQ(two.vertices_m.bottomRows(n), before.vertices_m.bottomRows(n));
  EXPECT_NE(two.vertices_m.topRows(n), before.vertices_m.topRows(n));
  EXPECT_LT((two.vertices_m.topRows(n).rowwise().norm().array() - radius).abs().maxCoeff(), 0.1 * radius);
}

TEST(FusedSurface, ends_where_a_sensor_looked_through) {
  // the upper half of a ball: what is below it may be anything, unless somebody looked into it from there
  constexpr double radius = 0.06, hollow = 0.045;
  const FusedViews fused = fuse_views({ball(radius, Vec3::Zero(), 20000, 0.0003, 0)});
  SurfaceOptions o;
  o.free = [](const Vec3& x) { return x.head<2>().norm() < hollow && x.z() < 0.02; };
  const auto deepest = [&](const TriMesh& m) {
    double depth = 0;  // of a vertex within the space that is free
    for (Index v = 0; v < m.vertices_m.rows(); ++v) {
      const Vec3 x = m.vertices_m.row(v);
      if (o.free(x)) depth = std::max(depth, std::min(hollow - x.head<2>().norm(), 0.02 - x.z()));
    }
    return depth;
  };
  const TriMesh whole = fused_surface(fused), cut = fused_surface(fused, o);
  EXPECT_TRUE(geometry::check_surface(cut).watertight());
  EXPECT_GT(deepest(whole), 0.01);
  EXPECT_LT(deepest(cut), 0.0003);
  EXPECT_LT(*geometry::check_surface(cut).volume_m3, *geometry::check_surface(whole).volume_m3 - 0.5 * M_PI * hollow * hollow * 0.02);
  double above = 0;  // nothing else moves
  for (Index v = 0; v < cut.vertices_m.rows(); ++v)
    if (cut.vertices_m(v, 2) > 0.3 * radius && cut.vertices_m.row(v).norm() > 0.9 * radius)
      above = std::max(above, std::abs(cut.vertices_m.row(v).norm() - radius));
  EXPECT_LT(above, 0.0005);
}

TEST(FusedSurface, rides_on_the_volume_without_what_floats_beside_it) {
  BuildOptions o;
  o.mesh.tetrahedra = 1500;
  o.fine_surface = true;
  const auto built =
      build_object({ball(0.05, Vec3::Zero(), 20000, 0.0003), ball(0.02, Vec3(0.1, 0, 0), 5000, 0.0003)}, {}, {}, o);
  const auto check = geometry::check_surface(built.fine_surface);
  EXPECT_TRUE(check.watertight());
  EXPECT_EQ(check.components, 1);
  EXPECT_LT(off_ball(built.fine_surface, 0.05).second, 0.0002);
  EXPECT_GT(built.fine_surface.triangles.rows(), 3 * built.model.surface.triangles.rows());
  ASSERT_EQ(built.fine_embedding.element.size(), built.fine_surface.vertices_m.rows());
  const Points stretched = 1.1 * built.model.volume.nodes_m;
  const Eigen::MatrixXd carried = geometry::embedded_points(built.fine_embedding, built.model.volume, stretched);
  EXPECT_LT((carried - 1.1 * built.fine_surface.vertices_m).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(FusedSurface, says_what_is_missing) {
  EXPECT_THROW(fused_surface({}), Error);
  const FusedViews fused = fuse_views({ball(0.05, Vec3::Zero(), 20000, 0)});
  SurfaceOptions negative, nowhere;
  negative.cell_m = -1;
  nowhere.belongs = [](const Vec3&) { return false; };
  EXPECT_THROW(fused_surface(fused, negative), Error);
  EXPECT_THROW(fused_surface(fused, nowhere), Error);
}

}  // namespace
}  // namespace palpate::reconstruction::fused_surface_test
