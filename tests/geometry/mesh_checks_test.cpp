// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/mesh_checks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"

namespace palpate::geometry::mesh_checks_test {
namespace {
using testing::Contains;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;

auto code(const std::string& c) { return Contains(Field(&Finding::code, c)); }

TEST(CheckSurface, says_nothing_about_a_sound_one) {
  const auto c = check_surface(shapes::torus(0.1, 0.03, 48, 24));
  EXPECT_TRUE(c.watertight());
  EXPECT_THAT(c.findings, IsEmpty());
  ASSERT_TRUE(c.volume_m3);
  EXPECT_NEAR(*c.volume_m3, 2 * M_PI * M_PI * 0.1 * 0.03 * 0.03, 0.02 * *c.volume_m3);
  const auto b = check_surface(shapes::box(Vec3(0.1, 0.2, 0.3), Vec3(5, 6, 7)));
  EXPECT_NEAR(*b.volume_m3, 0.006, 1e-15);
  EXPECT_NEAR(b.area_m2, 0.22, 1e-14);
  EXPECT_NEAR(b.diagonal_m(), Vec3(0.1, 0.2, 0.3).norm(), 1e-14);
  EXPECT_EQ(b.components, 1);
}

TEST(CheckSurface, names_every_fault) {
  const TriMesh box = shapes::box(0.1 * Vec3::Ones());
  TriMesh open = box;
  open.triangles.conservativeResize(11, 3);
  auto c = check_surface(open);
  EXPECT_EQ(c.boundary_edges, 3);
  EXPECT_FALSE(c.volume_m3);
  EXPECT_THAT(c.findings, code("open_surface"));

  TriMesh flipped = box;
  std::swap(flipped.triangles(4, 0), flipped.triangles(4, 1));
  c = check_surface(flipped);
  EXPECT_EQ(c.inconsistent_edges, 3);
  EXPECT_FALSE(c.volume_m3);
  EXPECT_THAT(c.findings, code("inconsistent_orientation"));

  TriMesh inside_out = box;
  inside_out.triangles.col(0).swap(inside_out.triangles.col(1));
  c = check_surface(inside_out);
  EXPECT_NEAR(*c.volume_m3, -1e-3, 1e-15);
  EXPECT_THAT(c.findings, code("inside_out"));

  c = check_surface(shapes::join(box, shapes::box(0.1 * Vec3::Ones(), Vec3(1, 0, 0))));
  EXPECT_EQ(c.components, 2);
  EXPECT_THAT(c.findings, code("several_components"));

  TriMesh twice = box;
  twice.triangles.conservativeResize(14, 3);
  twice.triangles.row(12) << box.triangles(0, 1), box.triangles(0, 2), box.triangles(0, 0);
  twice.triangles.row(13) << 0, 1, 1;
  c = check_surface(twice);
  EXPECT_EQ(c.duplicate_triangles, 1);
  EXPECT_EQ(c.degenerate_triangles, 1);
  EXPECT_EQ(c.non_manifold_edges, 0);
  EXPECT_TRUE(c.watertight());

  // two boxes that share an edge after welding (x from 0 to 0.1 and from 0.1 on, y apart), and two that share a corner
  c = check_surface(shapes::join(box, shapes::box(0.1 * Vec3::Ones(), Vec3(0.1, 0.1, 0))));
  EXPECT_EQ(c.coincident_vertices, 2);
  EXPECT_EQ(c.non_manifold_edges, 1);
  c = check_surface(shapes::join(box, shapes::box(0.1 * Vec3::Ones(), 0.1 * Vec3::Ones())));
  EXPECT_EQ(c.pinched_vertices, 1);
  EXPECT_EQ(c.components, 1);

  TriMesh stray = box;
  stray.vertices_m.conservativeResize(9, 3);
  stray.vertices_m.row(8) << 1e6, 0, 0;
  c = check_surface(stray);
  EXPECT_EQ(c.unused_vertices, 1);
  EXPECT_NEAR(c.diagonal_m(), 0.1 * std::sqrt(3.0), 1e-14);

  EXPECT_TRUE(check_surface(TriMesh{}).findings.at(0).fatal);
  stray.vertices_m(0, 0) = NAN;
  EXPECT_THAT(check_surface(stray).findings, code("not_finite"));
  TriMesh bad = box;
  bad.triangles(0, 0) = 99;
  EXPECT_THROW(check_surface(bad), Error);
}

TEST(CheckSurface, a_soup_of_separate_triangles_is_welded_for_the_checks) {
  const TriMesh box = shapes::box(Vec3::Ones());
  TriMesh stl;
  stl.vertices_m.resize(36, 3);
  stl.triangles.resize(12, 3);
  for (Index i = 0; i < 36; ++i) {
    stl.vertices_m.row(i) = box.vertices_m.row(box.triangles(i / 3, i % 3));
    stl.triangles(i / 3, i % 3) = i;
  }
  const auto c = check_surface(stl);
  EXPECT_TRUE(c.watertight());
  EXPECT_EQ(c.coincident_vertices, 28);
  EXPECT_NEAR(c.volume_m3.value_or(0), 1, 1e-15);
  EXPECT_EQ(weld(stl).vertices_m.rows(), 8);
}

TEST(CheckSurface, parts_that_have_faces_in_common_are_one_body) {
  const TriMesh half = shapes::box(Vec3(0.1, 0.2, 0.3));
  TriMesh other = half;  // beyond x = 0
  other.vertices_m.col(0) *= -1;
  other.triangles.col(1).swap(other.triangles.col(2));
  const TriMesh both = shapes::join(half, other);
  const auto c = check_surface(both);
  EXPECT_EQ(c.shared_faces, 2);
  EXPECT_EQ(c.duplicate_triangles, 0);
  EXPECT_TRUE(c.watertight());
  EXPECT_EQ(c.components, 1);
  EXPECT_NEAR(c.volume_m3.value_or(0), 0.2 * 0.2 * 0.3, 1e-15);
  EXPECT_NEAR(c.area_m2, 2 * (0.2 * 0.2 + 0.2 * 0.3 + 0.2 * 0.3), 1e-12);
  EXPECT_THAT(c.findings, testing::ElementsAre(testing::Field(&Finding::code, "shared_faces")));

  const auto seen = check_surface(without_shared_faces(both));
  EXPECT_TRUE(seen.findings.empty());
  EXPECT_EQ(seen.triangles, 20);
  EXPECT_EQ(seen.vertices, 12);
  EXPECT_NEAR(seen.volume_m3.value_or(0), *c.volume_m3, 1e-15);
  EXPECT_EQ(without_shared_faces(half).triangles, half.triangles);

  // Every triangle twice, once for each side, is how some programs draw a sheet; and a copy that faces the same way is a copy.
  TriMesh back = half;
  back.triangles.col(1).swap(back.triangles.col(2));
  EXPECT_EQ(check_surface(shapes::join(half, back)).shared_faces, 0);
  EXPECT_EQ(check_surface(shapes::join(half, back)).duplicate_triangles, 12);
  EXPECT_EQ(check_surface(shapes::join(half, half)).shared_faces, 0);
  TriMesh open = both;
  open.triangles.conservativeResize(open.triangles.rows() - 1, 3);
  EXPECT_EQ(check_surface(open).shared_faces, 0) << "nobody knows which of them is the surface";
}

TEST(CheckSurface, guesses_the_unit) {
  EXPECT_THAT(check_surface(shapes::box(Vec3(150, 40, 40))).findings,
              Contains(Field(&Finding::message, HasSubstr("150 m long: millimetres?"))));
  EXPECT_EQ(unit_guess(0.25), "");
  EXPECT_THAT(unit_guess(1e-4), HasSubstr("scaled twice"));
}

/// Six tetrahedra around the diagonal of a box.
TetMesh kuhn_box() {
  TetMesh m;
  m.nodes_m = shapes::box(Vec3(0.1, 0.2, 0.3)).vertices_m;
  m.tetrahedra.resize(6, 4);
  m.tetrahedra << 0, 1, 3, 7, 0, 3, 2, 7, 0, 2, 6, 7, 0, 6, 4, 7, 0, 4, 5, 7, 0, 5, 1, 7;
  return m;
}

TEST(CheckVolume, counts_and_measures) {
  const auto c = check_volume(kuhn_box());
  EXPECT_THAT(c.findings, IsEmpty());
  EXPECT_NEAR(c.volume_m3, 0.006, 1e-15);
  EXPECT_EQ(c.inverted + c.degenerate + c.unused_nodes + c.overfull_faces + c.non_manifold_boundary_edges, 0);
  EXPECT_EQ(c.components, 1);
  const double s = 1 / std::sqrt(2.0);
  const auto [low, high] = dihedral_range_deg({1, 0, -s}, {-1, 0, -s}, {0, 1, s}, {0, -1, s});
  EXPECT_NEAR(low, 180 / M_PI * std::acos(1.0 / 3), 1e-10);
  EXPECT_NEAR(high, low, 1e-10);
  TetMesh regular;
  regular.nodes_m.resize(4, 3);
  regular.nodes_m << 1, 0, -s, -1, 0, -s, 0, 1, s, 0, -1, s;
  regular.tetrahedra.resize(1, 4);
  regular.tetrahedra << 0, 2, 1, 3;
  EXPECT_NEAR(std::abs(check_volume(regular).worst_quality), 1, 1e-12);
}

TEST(CheckVolume, names_every_fault) {
  TetMesh m = kuhn_box();
  std::swap(m.tetrahedra(2, 0), m.tetrahedra(2, 1));
  EXPECT_EQ(check_volume(m).inverted, 1);
  EXPECT_THAT(check_volume(m).findings, code("inverted_elements"));
  m = kuhn_box();
  m.tetrahedra.row(3) = m.tetrahedra.row(0);
  EXPECT_EQ(check_volume(m).components, 1);
  m.tetrahedra(3, 0) = m.tetrahedra(3, 1);
  EXPECT_EQ(check_volume(m).degenerate, 1);
  m = kuhn_box();
  m.tetrahedra.conservativeResize(1, 4);
  EXPECT_EQ(check_volume(m).unused_nodes, 4);
  m = kuhn_box();
  Tetrahedra two(2, 4);
  two << m.tetrahedra.row(0), m.tetrahedra.row(3);  // share one edge, the diagonal
  m.tetrahedra = two;
  const auto c = check_volume(m);
  EXPECT_EQ(c.components, 2);
  EXPECT_EQ(c.non_manifold_boundary_edges, 1);
  m.tetrahedra.resize(1, 5);
  m.tetrahedra.setZero();
  EXPECT_THROW(check_volume(m), Error);
}

TEST(BoundarySurface, of_a_box_is_closed_and_faces_outward) {
  const auto b = boundary_surface(kuhn_box());
  const auto c = check_surface(b.surface);
  EXPECT_EQ(c.triangles, 12);
  EXPECT_TRUE(c.watertight());
  EXPECT_NEAR(c.volume_m3.value_or(0), 0.006, 1e-15);
  EXPECT_EQ(b.node.size(), 8u);
  EXPECT_EQ(b.tetrahedron.size(), 12u);
}

}  // namespace
}  // namespace palpate::geometry::mesh_checks_test
