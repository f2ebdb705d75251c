// label: statistics
// SPDX-License-Identifier: Apache-2.0
// One noisy view from the side of a ball and of a box on a table: what each completion makes of the other side.
#include "palpate/reconstruction/completion.hpp"

#include <gtest/gtest.h>

#include <random>

#include "geometry/overlap.hpp"
#include "geometry/shapes.hpp"
#include "palpate/lab/object.hpp"
#include "palpate/reconstruction/build_object.hpp"

namespace palpate::reconstruction::completion_test {
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
    EXPECT_GT(geometry::overlap(solid, geometry::Solid(mirrored.model.surface)), 0.88) << ball;
    EXPECT_NEAR(mirrored.check.volume_m3 / volume, 1, 0.1) << ball;
    EXPECT_GE(geometry::overlap(solid, geometry::Solid(mirrored.model.surface)), geometry::overlap(solid, geometry::Solid(planar.model.surface)) - 0.02) << ball;
    EXPECT_GT(hidden.check.volume_m3, 1.3 * volume) << ball;
    EXPECT_LE(tapered.check.volume_m3, 1.02 * planar.check.volume_m3) << ball;
    EXPECT_EQ(mirrored.check.inverted, 0);
    EXPECT_EQ(hidden.check.inverted, 0);
  }
}

Seen look_from(const std::shared_ptr<const geometry::TriangleTree>& tree, double around_degrees, double above_degrees);

// From above and from one side the flank that bends in is seen on that side alone. A ball has a symmetry in every upright plane, and one
// that says of one half of its back what is only guessed of the other says nothing. No sensor tells the lowest 8 mm from the table.
TEST(Completion, SymmetriesCarryASeenFlankAllAround) {
  const auto tree = std::make_shared<const geometry::TriangleTree>(shapes::sphere(0.06, 5, Vec3(0, 0, 0.052)));
  Seen seen = look_from(tree, -115, 39);
  const Seen above = look_from(tree, 0, 87);
  const auto below = [](const Points& a, const Points& b) {
    Points both(a.rows() + b.rows(), 3);
    both << a, b;
    return both;
  };
  seen.cloud.points_m = below(seen.cloud.points_m, above.cloud.points_m);
  seen.cloud.normals = below(seen.cloud.normals, above.cloud.normals);
  seen.fuse.free = [side = seen.fuse.free, top = above.fuse.free](const Vec3& p) { return p.z() > 0.008 && (side(p) || top(p)); };
  const BuiltObject built = complete_as(Completion::mirrored, seen);
  EXPECT_GT(built.symmetries, 1);
  const TriMesh& surface = built.model.surface;
  const auto widest_over_true = [&](double height_m, double band_m) {
    double widest_m = 0;
    for (Index v = 0; v < surface.vertices_m.rows(); ++v)
      if (std::abs(surface.vertices_m(v, 2) - height_m) < band_m) widest_m = std::max(widest_m, surface.vertices_m.row(v).head<2>().norm());
    return widest_m / std::sqrt(0.06 * 0.06 - std::pow(height_m - 0.052, 2));
  };
  EXPECT_NEAR(widest_over_true(0.021, 0.003), 1, 0.1);  // straight down it would be 1.17
  EXPECT_LT(widest_over_true(0.004, 0.002), 1.4);       // what no sensor tells from the table had made it 1.86
}

/// The lab's bear over the origin, facing -y.
TriMesh bear() {
  TriMesh surface = lab::make_object("bear").surface;
  const Vec3 middle = 0.5 * (surface.vertices_m.colwise().minCoeff() + surface.vertices_m.colwise().maxCoeff()).transpose();
  surface.vertices_m.rowwise() -= Vec3(middle.x(), middle.y(), 0).transpose();
  return surface;
}

Seen look_from(const std::shared_ptr<const geometry::TriangleTree>& tree, double around_degrees, double above_degrees) {
  const double around = around_degrees * M_PI / 180, above = above_degrees * M_PI / 180;
  const Vec3 middle(0, 0, 0.1), away(std::cos(above) * std::cos(around), std::cos(above) * std::sin(around), std::sin(above));
  return look(tree, middle + 0.6 * away, middle, 0.0008);
}

// It sits askew: its own symmetry is none of the planes across the line of sight, and says where the other arm and leg are.
TEST(Completion, OwnSymmetryShowsTheOtherSide) {
  const TriMesh truth = bear();
  const auto tree = std::make_shared<const geometry::TriangleTree>(truth);
  const geometry::Solid solid(truth);
  const double volume = *geometry::check_surface(truth).volume_m3;
  for (const double degrees : {-138.0, -150.0, -30.0}) {
    const Seen seen = look_from(tree, degrees, 34);
    const auto mirrored = complete_as(Completion::mirrored, seen), planar = complete_as(Completion::planar, seen);
    EXPECT_EQ(mirrored.symmetries, 1);
    EXPECT_EQ(planar.symmetries, 0);  // not looked for
    const double whole = geometry::overlap(solid, geometry::Solid(mirrored.model.surface));
    EXPECT_GT(whole, 0.72) << degrees;
    EXPECT_GT(whole, geometry::overlap(solid, geometry::Solid(planar.model.surface)) + 0.03) << degrees;
    EXPECT_NEAR(mirrored.check.volume_m3 / volume, 1, 0.15) << degrees;
  }
}

// Of what is seen from its front alone only the bend of its rim shows how deep it is, and rims are seen badly.
TEST(Completion, ATouchBehindSaysHowFarBackTheObjectReaches) {
  for (const double depth : {0.5, 0.75}) {
    TriMesh egg = shapes::sphere(0.06, 5, Vec3(0, 0, 0.058));
    egg.vertices_m.col(0) *= depth;
    const auto tree = std::make_shared<const geometry::TriangleTree>(egg);
    const geometry::Solid solid(egg);
    Seen seen = look(tree, Vec3(-0.5, 0, 0.12), Vec3(0, 0, 0.05), 0.0008);
    const auto shared = [&] {
      return geometry::overlap(solid, geometry::Solid(complete_as(Completion::mirrored, seen).model.surface));
    };
    const double without = shared();
    const Vec3 inward = -Vec3(0.9, 0.1, 0.3).normalized(), from = Vec3(0, 0, 0.058) - 0.3 * inward;
    seen.fuse.touched = {{from + tree->cast(from, inward)->range_m * inward, inward, 0.012}};
    const double with = shared();
    EXPECT_GT(with, 0.9) << depth;
    EXPECT_GT(with, without - 0.05) << depth;
    if (depth == 0.75) {
      EXPECT_GT(with, without + 0.1);
    }
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
  // not as a pillar of the tool's width, which would give way by itself
  for (const double side : {-1.0, 1.0}) EXPECT_TRUE(solid.inside(seen.fuse.touched[0].point_m + 0.02 * inward + 0.03 * side * Vec3::UnitY()));
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
}  // namespace palpate::reconstruction::completion_test
