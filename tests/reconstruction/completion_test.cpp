// label: statistics
// SPDX-License-Identifier: Apache-2.0
// One noisy view from the side of a ball and of a box on a table: what each completion makes of the other side.
#include "palpate/reconstruction/completion.hpp"

#include <gtest/gtest.h>

#include <random>

#include "geometry/shapes.hpp"
#include "palpate/geometry/solid.hpp"
#include "palpate/reconstruction/build_object.hpp"

namespace palpate::reconstruction {
namespace {

struct Seen {
  PointCloud cloud;
  FuseOptions fuse;
};

/// From `eye`, about 525 pixels of focal length, every second row and column; noise along the ray.
Seen look(const std::shared_ptr<const geometry::TriangleTree>& tree, const Vec3& eye, const Vec3& at, double sigma) {
  std::mt19937 rng(4);
  std::normal_distribution<double> g(0, sigma);
  const Vec3 ahead = (at - eye).normalized(), u = ahead.unitOrthogonal(), v = ahead.cross(u);
  std::vector<Vec3> points, normals;
  const TriMesh& m = tree->mesh();
  for (int y = -200; y <= 200; y += 2)
    for (int x = -200; x <= 200; x += 2) {
      const Vec3 d = (ahead + x / 525.0 * u + y / 525.0 * v).normalized();
      const auto hit = tree->cast(eye, d);
      if (!hit) continue;
      const auto corner = [&](int k) { return Vec3(m.vertices_m.row(m.triangles(hit->triangle, k))); };
      const Vec3 n = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
      if (-n.dot(d) < 0.2) continue;
      points.push_back(eye + (hit->range_m + g(rng)) * d);
      normals.push_back(n);
    }
  Seen out;
  out.cloud.points_m.resize(Index(points.size()), 3), out.cloud.normals.resize(Index(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i)
    out.cloud.points_m.row(Index(i)) = points[i].transpose(), out.cloud.normals.row(Index(i)) = normals[i].transpose();
  out.cloud.sigma_m = VectorX::Constant(1, sigma);
  out.fuse.support = Plane{Vec3::Zero(), Vec3::UnitZ()};
  out.fuse.free = [tree, eye, sigma](const Vec3& p) {
    const double far = (p - eye).norm();
    const auto hit = tree->cast(eye, (p - eye) / far);
    return !hit || far < hit->range_m - 4 * sigma;
  };
  return out;
}

/// Shared volume over that of both together.
double overlap(const geometry::Solid& a, const geometry::Solid& b) {
  const Vec3 low = a.min_m().cwiseMin(b.min_m()), extent = a.max_m().cwiseMax(b.max_m()) - low;
  std::mt19937 rng(9);
  std::uniform_real_distribution<double> u;
  int both = 0, any = 0;
  for (int i = 0; i < 8000; ++i) {
    const Vec3 p = low + extent.cwiseProduct(Vec3(u(rng), u(rng), u(rng)));
    const bool in_a = a.inside(p), in_b = b.inside(p);
    both += in_a && in_b, any += in_a || in_b;
  }
  return double(both) / any;
}

BuiltObject complete_as(Completion completion, Seen seen) {
  seen.fuse.completion = completion;
  BuildOptions options;
  options.mesh.tetrahedra = 2000;
  return build_object({seen.cloud}, seen.fuse, {}, options);
}

TEST(Completion, MirrorFindsTheBackOfABallAndOfABox) {
  for (const bool ball : {true, false}) {
    const TriMesh truth = ball ? shapes::sphere(0.06, 5, Vec3(0, 0, 0.058)) : shapes::box(Vec3(0.12, 0.12, 0.12), Vec3(-0.06, -0.06, 0));
    const auto tree = std::make_shared<const geometry::TriangleTree>(truth);
    const geometry::Solid solid(truth);
    const Seen seen = look(tree, Vec3(-0.5, 0.05, 0.35), Vec3(0, 0, 0.05), 0.0008);
    const double volume = *geometry::check_surface(truth).volume_m3;
    const auto mirrored = complete_as(Completion::mirrored, seen), planar = complete_as(Completion::planar, seen),
               hidden = complete_as(Completion::hidden, seen), tapered = complete_as(Completion::tapered, seen);
    EXPECT_GT(overlap(solid, geometry::Solid(mirrored.model.surface)), 0.88) << ball;
    EXPECT_NEAR(mirrored.check.volume_m3 / volume, 1, 0.1) << ball;
    EXPECT_GE(overlap(solid, geometry::Solid(mirrored.model.surface)), overlap(solid, geometry::Solid(planar.model.surface)) - 0.02) << ball;
    EXPECT_GT(hidden.check.volume_m3, 1.3 * volume) << ball;
    EXPECT_LE(tapered.check.volume_m3, 1.02 * planar.check.volume_m3) << ball;
    EXPECT_EQ(mirrored.check.inverted, 0);
    EXPECT_EQ(hidden.check.inverted, 0);
  }
}

TEST(Completion, ReachesToWhereAToolMetTheUnseenSide) {
  const TriMesh ball = shapes::sphere(0.06, 5, Vec3(0, 0, 0.058));
  const auto tree = std::make_shared<const geometry::TriangleTree>(ball);
  Seen seen = look(tree, Vec3(-0.5, 0, 0.2), Vec3(0, 0, 0.05), 0.0008);
  const Vec3 inward = -Vec3(0.8, 0, 0.6);
  seen.fuse.touched = {{Vec3(0, 0, 0.058) - 0.06 * inward, inward, 0.015}};
  const auto built = complete_as(Completion::planar, seen);
  const geometry::Solid solid(built.model.surface);
  EXPECT_TRUE(solid.inside(seen.fuse.touched[0].point_m + 0.005 * inward));
  EXPECT_FALSE(solid.inside(seen.fuse.touched[0].point_m - 0.008 * inward));
}

TEST(Completion, WithoutFreeSpaceNothingIsGuessed) {
  const auto tree = std::make_shared<const geometry::TriangleTree>(shapes::sphere(0.06, 4, Vec3(0, 0, 0.058)));
  Seen seen = look(tree, Vec3(-0.5, 0, 0.35), Vec3(0, 0, 0.05), 0.0008);
  seen.fuse.free = {};
  seen.fuse.completion = Completion::planar;
  const FusedViews planar = fuse_views({seen.cloud}, seen.fuse);
  seen.fuse.completion = Completion::hidden;
  EXPECT_EQ(fuse_views({seen.cloud}, seen.fuse).facets.vertices_m, planar.facets.vertices_m);
}

}  // namespace
}  // namespace palpate::reconstruction
