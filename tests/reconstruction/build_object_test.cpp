// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/build_object.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/geometry/embedding.hpp"
#include "palpate/geometry/stand_on.hpp"
#include "palpate/lab/implicit_surface.hpp"

namespace palpate::reconstruction::build_object_test {
namespace {

TEST(BuildObject, a_surface_rides_on_its_volume_and_the_support_plane_finds_nodes) {
  const TriMesh box = shapes::box(Vec3(0.06, 0.05, 0.08));
  Support table;
  table.kind = SupportKind::table;
  table.plane = {Vec3::Zero(), Vec3::UnitZ()};
  BuildOptions o;
  o.mesh.tetrahedra = 1500;
  const auto built = build_object(box, {table}, o);
  EXPECT_EQ(built.check.inverted, 0);
  EXPECT_LT(std::abs(built.volume_error.value_or(1)), 0.02);
  EXPECT_LT(
      (geometry::embedded_points(built.model.embedding, built.model.volume, built.model.volume.nodes_m) - box.vertices_m)
          .cwiseAbs()
          .maxCoeff(),
      1e-12);
  int held = 0;
  for (Index n = 0; n < built.model.volume.nodes_m.rows(); ++n)
    held += std::abs(built.model.volume.nodes_m(n, 2)) <= built.model.supports.at(0).tolerance_m;
  // the bottom has 0.003 m2: about one node per squared edge
  EXPECT_GT(held, 15);
  EXPECT_EQ(built.model.unseen_share, 0);
}

/// Area of the volume's boundary faces that lie in a plane, within the tolerance that a support holds, m2, and their middle.
std::pair<double, Vec3> foot_on(const Plane& plane, const TetMesh& volume) {
  const TriMesh boundary = geometry::boundary_surface(volume).surface;
  double area = 0;
  Vec3 middle = Vec3::Zero();
  for (Index t = 0; t < boundary.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(boundary.vertices_m.row(boundary.triangles(t, k))); };
    bool on = true;
    for (int k = 0; k < 3; ++k) on = on && std::abs(plane.normal.dot(corner(k) - plane.point_m)) < Support{}.tolerance_m;
    if (!on) continue;
    const double own = 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    area += own;
    middle += own * (corner(0) + corner(1) + corner(2)) / 3;
  }
  return {area, middle / area};
}

double area_on(const Plane& plane, const TetMesh& volume) { return foot_on(plane, volume).first; }

// A bar that is fine at its far end only: the mesher has cut the edges of its foot off, and the foot is what carries it.
TEST(StandOn, a_slender_object_stands_on_its_whole_foot) {
  const TriMesh bar = shapes::box(Vec3(0.06, 0.06, 0.18));
  Support table;
  table.kind = SupportKind::table;
  table.plane = {Vec3::Zero(), Vec3::UnitZ()};
  BuildOptions o;
  o.mesh.tetrahedra = 3000;
  o.mesh.finer.push_back({Vec3(0.03, 0.03, 0.18), 0.02, 0.005});
  const auto coarse = build_object(bar, {table}, o);
  for (const auto& near : geometry::finer_at_feet(table.plane, bar)) o.mesh.finer.push_back(near);
  const auto built = build_object(bar, {table}, o);
  EXPECT_EQ(built.check.inverted, 0);
  const double foot_m2 = 0.06 * 0.06;
  EXPECT_GT(area_on(table.plane, built.model.volume), 0.97 * foot_m2);
  EXPECT_LT(area_on(table.plane, built.model.volume), 1.0001 * foot_m2);
  EXPECT_GT(area_on(table.plane, coarse.model.volume), 0.7 * foot_m2);
  EXPECT_LT(std::abs(built.check.volume_m3 / (foot_m2 * 0.18) - 1), 0.02);
}

// Beside its foot a ball leaves the table so slowly that the mesher's faces there all but lie on it. A foot that is held half a
// millimetre to one side tilts the ball under a push: nu was wrong by 0.05.
TEST(StandOn, a_ball_stands_in_the_middle_of_its_foot) {
  const double radius_m = 0.075, height_m = 0.065;  // of the centre above the table
  const TriMesh ball = lab::implicit_surface([&](const Vec3& p) { return (p - Vec3(0, 0, height_m)).norm() - radius_m; },
                                             {Vec3(-0.085, -0.085, 0), Vec3(0.085, 0.085, 0.15), 0.004});
  Support table;
  table.kind = SupportKind::table;
  table.plane = {Vec3::Zero(), Vec3::UnitZ()};
  const double foot_m2 = EIGEN_PI * (radius_m * radius_m - height_m * height_m);
  for (int tetrahedra : {2000, 3000, 5000}) {
    BuildOptions o;
    o.mesh.tetrahedra = tetrahedra;
    o.mesh.finer = geometry::finer_at_feet(table.plane, ball);
    const auto built = build_object(ball, {table}, o);
    EXPECT_EQ(built.check.inverted, 0);
    const auto [area_m2, middle_m] = foot_on(table.plane, built.model.volume);
    EXPECT_NEAR(area_m2 / foot_m2, 1, 0.03) << tetrahedra;
    EXPECT_LT(middle_m.norm(), 2e-4) << tetrahedra;
  }
}

TEST(StandOn, feet_are_told_apart) {
  const TriMesh two = shapes::join(shapes::box(Vec3(0.02, 0.02, 0.05)), shapes::box(Vec3(0.05, 0.05, 0.05), Vec3(0.1, 0, 0)));
  const auto finer = geometry::finer_at_feet({Vec3::Zero(), Vec3::UnitZ()}, two);
  ASSERT_GE(finer.size(), 8u);
  for (const auto& near : finer) {
    EXPECT_EQ(near.point_m.z(), 0);
    EXPECT_NEAR(near.edge_m, near.point_m.x() < 0.05 ? 0.0024 : 0.006, 1e-9);
  }
  EXPECT_TRUE(geometry::finer_at_feet({Vec3(0, 0, -1), Vec3::UnitZ()}, two).empty());
}

TEST(BuildObject, a_given_volume_stays_as_it_is_and_a_broken_one_is_refused) {
  BuildOptions o;
  o.mesh.tetrahedra = 300;
  TetMesh volume = build_object(shapes::sphere(0.05, 3), {}, o).model.volume;
  const auto built = build_object(volume, {});
  EXPECT_EQ(built.model.volume.nodes_m, volume.nodes_m);
  EXPECT_GT(built.model.surface.triangles.rows(), 50);
  std::swap(volume.tetrahedra(5, 0), volume.tetrahedra(5, 1));
  EXPECT_THROW(build_object(volume, {}), Error);
}

TEST(BuildObject, supports_by_node_number_need_a_given_volume) {
  Support nodes;
  nodes.name = "base";
  nodes.vertices = {0, 1, 2};
  try {
    build_object(shapes::sphere(0.05, 2), {nodes});
    FAIL();
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("base"));
  }
}

}  // namespace
}  // namespace palpate::reconstruction::build_object_test
