// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/tetrahedralise.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/geometry/solid.hpp"
#include "palpate/geometry/stand_on.hpp"
#include "palpate/geometry/surface_distance.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/geometry/winding_number.hpp"
#include "palpate/lab/box_surface.hpp"
#include "refusals.hpp"

namespace palpate::geometry::tetrahedralise_test {
namespace {

using testing::Contains;
using testing::Field;
using testing::HasSubstr;

Tetrahedralisation with(const TriMesh& m, Index count) {
  TetrahedraliseOptions o;
  o.tetrahedra = count;
  return tetrahedralise(m, o);
}

void expect_usable(const Tetrahedralisation& r) {
  EXPECT_EQ(r.check.inverted + r.check.degenerate + r.check.overfull_faces + r.check.unused_nodes, 0);
  EXPECT_EQ(r.check.non_manifold_boundary_edges, 0);
  EXPECT_EQ(r.check.pinched_boundary_vertices, 0);
  EXPECT_GE(r.check.min_dihedral_deg, 15);
  EXPECT_LE(r.check.max_dihedral_deg, 150);
  EXPECT_TRUE(check_surface(boundary_surface(r.mesh).surface).watertight());
}

TEST(WindingNumber, is_one_inside_and_zero_outside) {
  const TriMesh m = shapes::torus(0.7, 0.2, 60, 30);
  const WindingNumber w(m);
  EXPECT_NEAR(w(Vec3(0.7, 0, 0)), 1, 0.05);
  EXPECT_NEAR(w(Vec3(0, 0, 0)), 0, 0.05);
  EXPECT_NEAR(w(Vec3(0.7, 0.01, 0.19)), 1, 0.05);
  EXPECT_NEAR(w(Vec3(0.7, 0.01, 0.21)), 0, 0.05);
  EXPECT_NEAR(w(Vec3(5, 5, 5)), 0, 0.005);
  const Index t = 100;
  const Vec3 middle =
      (m.vertices_m.row(m.triangles(t, 0)) + m.vertices_m.row(m.triangles(t, 1)) + m.vertices_m.row(m.triangles(t, 2)))
          .transpose() /
      3;
  EXPECT_NEAR(w.without(middle, t), 0.5, 0.05);
}

TEST(Tetrahedralise, a_sphere_keeps_volume_surface_and_count) {
  const TriMesh m = shapes::sphere(0.05, 4);
  for (const Index count : {1000, 4000}) {
    const auto r = with(m, count);
    expect_usable(r);
    EXPECT_NEAR(r.check.tetrahedra, count, 0.25 * count);
    EXPECT_LT(std::abs(r.volume_error.value_or(1)), 0.005);
    EXPECT_LT(r.surface_rms_m, 0.0025 * r.surface.diagonal_m());
    EXPECT_EQ(r.check.components, 1);
    EXPECT_THAT(r.warnings, testing::IsEmpty());
  }
}

TEST(Tetrahedralise, a_hole_through_the_object_stays_open) {
  const auto r = with(shapes::torus(0.1, 0.03, 64, 32), 3000);
  expect_usable(r);
  // Euler characteristic of a torus is zero
  const auto b = boundary_surface(r.mesh).surface;
  EXPECT_EQ(b.vertices_m.rows() - 3 * b.triangles.rows() / 2 + b.triangles.rows(), 0);
}

TEST(Tetrahedralise, sharp_edges_are_kept_within_a_share_of_an_edge) {
  const auto r = with(shapes::box(Vec3(0.03, 0.03, 0.1)), 3000);
  expect_usable(r);
  EXPECT_LT(std::abs(*r.volume_error), 0.01);
  EXPECT_LT(r.hausdorff_m, 0.02 * r.surface.diagonal_m());
}

/// Mean distance of a box's edges to the boundary of a mesh of it.
double off_the_edges_m(const TetMesh& mesh, const Vec3& size_m) {
  const TriangleTree tree(boundary_surface(mesh).surface);
  double sum_m = 0;
  int count = 0;
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 4; ++side)
      for (int k = 0; k <= 50; ++k) {
        Vec3 p;
        p(axis) = size_m(axis) * k / 50;
        p((axis + 1) % 3) = side % 2 * size_m((axis + 1) % 3);
        p((axis + 2) % 3) = side / 2 * size_m((axis + 2) % 3);
        sum_m += std::sqrt(tree.closest(p).squared_distance_m2);
        ++count;
      }
  return sum_m / count;
}

/// Where a mesh is coarse a least-squares fit alone leaves chamfers: the bar below then bends 4 per cent too far.
TEST(Tetrahedralise, boxes_keep_their_edges_where_the_mesh_is_coarse) {
  for (const Vec3& size : {Vec3(0.08, 0.08, 0.16), Vec3(0.15, 0.15, 0.15), Vec3(0.2, 0.1, 0.03)}) {
    TetrahedraliseOptions o;
    o.tetrahedra = 3000;
    if (size.z() > 0.05) o.finer = {{Vec3(0.5 * size.x(), 0.5 * size.y(), size.z()), 0.02, 0.006}};
    const auto r = tetrahedralise(shapes::box(size), o);
    expect_usable(r);
    EXPECT_LT(std::abs(*r.volume_error), 0.003);
    EXPECT_LT(r.surface_rms_m, 0.001 * r.surface.diagonal_m());
    EXPECT_LT(off_the_edges_m(r.mesh, size), 0.0015 * r.surface.diagonal_m());
  }
}

/// Where neighbours on the edge stand in a vertex's way it finds room further along: else it stays beside the edge, which is
/// then cut off over an element (6.8e-4 in the mean of these).
TEST(Tetrahedralise, edges_of_boxes_are_cut_off_nowhere) {
  double sum_m = 0;
  for (int i = 0; i < 8; ++i) {
    const Vec3 size(1, 1 + 0.05 * i, 1 + 0.11 * i);
    const auto r = with(shapes::box(size), 2000);
    expect_usable(r);
    sum_m += off_the_edges_m(r.mesh, size);
  }
  EXPECT_LT(sum_m / 8, 6.5e-4);
}

TEST(Tetrahedralise, corners_of_boxes_are_nodes) {
  for (const Vec3& size : {Vec3(0.1, 0.1, 0.1), Vec3(0.2, 0.1, 0.1), Vec3(0.3, 0.2, 0.1), Vec3(1, 1, 0.1)}) {
    const TriMesh box = shapes::box(size);
    const auto r = with(box, 1000);
    expect_usable(r);
    for (Index v = 0; v < 8; ++v)
      EXPECT_LT((r.mesh.nodes_m.rowwise() - box.vertices_m.row(v)).rowwise().norm().minCoeff(), 1e-12)
          << size.transpose() << ", corner " << v;
  }
}

TEST(Tetrahedralise, thin_spikes_and_sharp_edges_survive_with_few_elements) {
  // a star of twelve arms: its edges are sharper than the elements that its volume alone would get
  std::vector<Vec3> v;
  std::vector<std::array<Index, 3>> t;
  constexpr Index n = 24, m = n + 1;
  for (int z = 0; z < 2; ++z) {
    for (Index i = 0; i < n; ++i) {
      const double a = 2 * M_PI * i / n, r = i % 2 ? 0.05 : 0.1;
      v.emplace_back(r * std::cos(a), r * std::sin(a), 0.02 * z);
    }
    v.emplace_back(0, 0, 0.02 * z);
  }
  for (Index i = 0; i < n; ++i) {
    const Index j = (i + 1) % n;
    t.insert(t.end(), {{n, j, i}, {m + n, m + i, m + j}, {i, j, m + j}, {i, m + j, m + i}});
  }
  const auto r = with(shapes::make(v, t), 3000);
  expect_usable(r);
  EXPECT_EQ(r.check.components, 1);
  EXPECT_NEAR(r.check.tetrahedra, 3000, 450);
  EXPECT_LT(std::abs(*r.volume_error), 0.02);
  EXPECT_LT(r.surface_rms_m, 0.0025 * r.surface.diagonal_m());
  EXPECT_LT(r.hausdorff_m, 0.02 * r.surface.diagonal_m());
}

TEST(Tetrahedralise, what_is_buried_in_other_parts_need_not_be_met) {
  // a small ball inside a large one, facing outward: the union has no cavity
  const auto r = with(shapes::join(shapes::sphere(0.05, 4), shapes::sphere(0.01, 3)), 2000);
  expect_usable(r);
  EXPECT_LT(r.hausdorff_m, 0.01 * r.surface.diagonal_m());
  EXPECT_NEAR(r.check.volume_m3, 4.0 / 3 * M_PI * std::pow(0.05, 3), 0.01 * r.check.volume_m3);
}

TEST(Tetrahedralise, is_repeatable) {
  const TriMesh m = shapes::torus(0.1, 0.03, 32, 16);
  EXPECT_EQ(with(m, 800).mesh.nodes_m, with(m, 800).mesh.nodes_m);
}

/// A fifth of the triangles deleted, half of the rest flipped, a tenth doubled.
TriMesh broken_copy(const TriMesh& whole, unsigned seed) {
  std::mt19937 rng(seed);
  TriMesh broken = whole;
  Index n = 0;
  for (Index i = 0; i < whole.triangles.rows(); ++i) {
    if (rng() % 5 == 0) continue;
    auto t = Eigen::Matrix<Index, 1, 3>(whole.triangles.row(i));
    if (rng() % 2 == 0) std::swap(t[0], t[1]);
    broken.triangles.conservativeResize(std::max<Eigen::Index>(broken.triangles.rows(), n + 2), 3);
    broken.triangles.row(n++) = t;
    if (rng() % 10 == 0) broken.triangles.row(n++) = t;
  }
  broken.triangles.conservativeResize(n, 3);
  return broken;
}

TEST(Tetrahedralise, copes_with_missing_flipped_and_doubled_triangles) {
  const TriMesh whole = shapes::torus(0.1, 0.035, 80, 40);
  const TriMesh broken = broken_copy(whole, 4);
  const auto r = with(broken, 3000);
  expect_usable(r);
  EXPECT_FALSE(r.volume_error);
  const double truth = *check_surface(whole).volume_m3;
  EXPECT_NEAR(r.check.volume_m3, truth, 0.02 * truth);
  const auto d = surface_distance(whole, boundary_surface(r.mesh).surface);
  EXPECT_LT(d.rms_m, 0.0025 * r.surface.diagonal_m());
  EXPECT_LT(d.hausdorff_m, 0.02 * r.surface.diagonal_m());
}

TEST(Solid, lids_that_meet_at_an_edge_close_it_all_the_same) {
  // triangles around a corner are missed together: lids then run along edges that others already share
  const TriMesh whole = shapes::torus(0.1, 0.035, 40, 20);
  const double volume = *check_surface(whole).volume_m3;
  for (unsigned seed = 0; seed < 12; ++seed) {
    const Solid solid(broken_copy(whole, seed));
    EXPECT_TRUE(solid.watertight()) << "seed " << seed;
    EXPECT_NEAR(solid.signed_volume_m3(), volume, 0.005 * volume) << "seed " << seed;
  }
}

TEST(Solid, small_holes_are_closed_and_rims_of_open_parts_are_not) {
  // single triangles of a cube come back exactly, two that share an edge as well
  TriMesh cube = shapes::box(Vec3(0.1, 0.2, 0.3));
  TriMesh holed = cube;
  holed.triangles.row(7) = Eigen::Matrix<Index, 1, 3>(cube.triangles.row(10));
  holed.triangles.row(3) = Eigen::Matrix<Index, 1, 3>(cube.triangles.row(11));
  holed.triangles.conservativeResize(10, 3);
  const Solid solid(holed);
  EXPECT_TRUE(solid.watertight());
  EXPECT_EQ(solid.orientation().cover_width_m.size(), 2u);
  EXPECT_NEAR(solid.signed_volume_m3(), 0.006, 1e-12);
  EXPECT_EQ(solid.hole_width_m(0), 0);
  EXPECT_GT(solid.hole_width_m(11), 0.05);
  TriMesh open = cube;
  open.triangles.conservativeResize(6, 3);  // three sides: the lid is as large as what is there
  EXPECT_FALSE(Solid(open).watertight());
  open.triangles.conservativeResize(1, 3);
  EXPECT_EQ(Solid(open).surface().triangles.rows(), 1);
}

TEST(Tetrahedralise, overlapping_pieces_become_their_union) {
  const auto r = with(shapes::join(shapes::sphere(0.05, 4), shapes::sphere(0.05, 4, Vec3(0.05, 0, 0))), 4000);
  expect_usable(r);
  EXPECT_EQ(r.check.components, 1);
  const double ball = 4.0 / 3 * M_PI * std::pow(0.05, 3), lens = M_PI / 12 * std::pow(0.05, 3) * (4 + 1);
  EXPECT_NEAR(r.check.volume_m3, 2 * ball - lens, 0.01 * ball);
  ASSERT_TRUE(r.volume_error);  // of the union, not of what is counted twice
  EXPECT_LT(std::abs(*r.volume_error), 0.01);
}

TEST(Tetrahedralise, parts_with_faces_in_one_plane_are_counted_once) {
  // an L of two bars that overlap in the corner and have four faces there in common
  const auto r = with(shapes::join(shapes::box(Vec3(0.1, 0.02, 0.02)), shapes::box(Vec3(0.02, 0.1, 0.02))), 2000);
  expect_usable(r);
  EXPECT_NEAR(r.check.volume_m3, 7.2e-5, 0.01 * 7.2e-5);
  ASSERT_TRUE(r.volume_error);
  EXPECT_LT(std::abs(*r.volume_error), 0.01);
}

// The face between two halves was a wall, with elements as fine as its triangles, and its rim was no surface for rays.
TEST(Tetrahedralise, halves_that_share_a_face_are_filled_as_one) {
  const TriMesh half = lab::box_surface({0, -0.05, 0}, {0.05, 0.05, 0.1}, 8);
  TriMesh other = half;
  other.vertices_m.col(0) *= -1;
  other.triangles.col(1).swap(other.triangles.col(2));
  const TriMesh both = shapes::join(half, other);
  EXPECT_EQ(orient(both).mesh.triangles.rows(), 2 * half.triangles.rows() - 2 * 2 * 8 * 8);
  EXPECT_TRUE(orient(both).closed);
  const auto r = with(both, 2000);
  expect_usable(r);
  EXPECT_NEAR(r.check.volume_m3, 1e-3, 1e-5);
  EXPECT_LT(std::abs(double(r.mesh.tetrahedra.rows()) / double(with(lab::box_surface({-0.05, -0.05, 0}, {0.05, 0.05, 0.1}, 8), 2000).mesh.tetrahedra.rows()) - 1), 0.2);
}

/// A ball of 5 cm with a wall.
TriMesh hollow_ball(double wall) {
  TriMesh inner = shapes::sphere(0.05 - wall, 4);
  inner.triangles.col(1).swap(inner.triangles.col(2));
  return shapes::join(shapes::sphere(0.05, 4), inner);
}

TEST(Tetrahedralise, thin_walls_stay_whole_or_are_refused) {
  const auto r = with(hollow_ball(0.003), 4000);  // more than asked where it takes more
  expect_usable(r);
  EXPECT_EQ(r.check.components, 1);
  EXPECT_LT(std::abs(*r.volume_error), 0.1);
  EXPECT_LT(r.hausdorff_m, 0.02 * r.surface.diagonal_m());
  EXPECT_THAT(message_of([] { with(hollow_ball(0.00005), 3000); }), HasSubstr("too thin to be filled"));
  EXPECT_THAT(message_of([] { with(shapes::box(Vec3(0.2, 0.2, 0.0001)), 3000); }), HasSubstr("too thin to be filled"));
  EXPECT_THAT(message_of([] { with(shapes::box(Vec3(0.2, 0.2, 0.0005)), 500); }), HasSubstr("too thin for 500 tetrahedra"));
}

/// The lattice is laid over all of the box: it filled the memory.
TEST(Tetrahedralise, a_stray_triangle_far_away_is_refused_at_once) {
  TriMesh mesh = shapes::sphere(0.05, 3);
  const Index first = static_cast<Index>(mesh.vertices_m.rows());
  mesh.vertices_m.conservativeResize(first + 3, 3);
  mesh.vertices_m.bottomRows(3) << 5, 5, 5, 5.0001, 5, 5, 5, 5.0001, 5;
  mesh.triangles.conservativeResize(mesh.triangles.rows() + 1, 3);
  mesh.triangles.bottomRows(1) << first, first + 1, first + 2;
  TetrahedraliseOptions options;
  options.tetrahedra = 4000;
  try {
    tetrahedralise(mesh, options);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(error.message().find("leave out stray triangles"), std::string::npos) << error.message();
  }
}

TEST(Tetrahedralise, walls_far_too_thin_are_refused_before_any_work) {
  int told = 0;
  const auto count = [&](std::string_view, double) { return ++told > 0; };
  TetrahedraliseOptions options;
  options.tetrahedra = 3000;
  const auto sheet = [&] { tetrahedralise(shapes::box(Vec3(0.2, 0.2, 0.001)), options, count); };
  EXPECT_THAT(message_of(sheet), HasSubstr("too thin for 3000 tetrahedra; walls of that width and size take some 3e+04"));
  EXPECT_EQ(told, 0);
}

TEST(Tetrahedralise, an_inner_shell_that_faces_inward_is_a_cavity_and_all_inside_out_is_turned) {
  TriMesh inner = shapes::sphere(0.03, 3);
  inner.triangles.col(0).swap(inner.triangles.col(1));
  const TriMesh shell = shapes::join(shapes::sphere(0.05, 4), inner);
  const auto r = with(shell, 6000);
  expect_usable(r);
  EXPECT_LT(std::abs(*r.volume_error), 0.02);
  TriMesh turned = shell;
  turned.triangles.col(0).swap(turned.triangles.col(1));
  const auto t = with(turned, 6000);
  EXPECT_EQ(t.flipped_triangles, turned.triangles.rows());
  EXPECT_NEAR(t.check.volume_m3, r.check.volume_m3, 1e-3 * r.check.volume_m3);
}

// It was carved away: of two balls side by side one was missing, and of parts that overlap what they have in common.
TEST(Tetrahedralise, a_part_that_was_written_inside_out_is_turned) {
  const auto turned = [](TriMesh mesh) {
    mesh.triangles.col(1).swap(mesh.triangles.col(2));
    return mesh;
  };
  const TriMesh body = shapes::sphere(0.05, 3), beside = shapes::sphere(0.03, 3, Vec3(0.1, 0, 0)), through = shapes::sphere(0.03, 3, Vec3(0.05, 0, 0)),
                within = shapes::sphere(0.02, 3);
  for (const TriMesh& part : {beside, through}) {
    const TriMesh mesh = shapes::join(body, turned(part));
    const OrientedSurface oriented = orient(mesh);
    EXPECT_EQ(oriented.flipped, part.triangles.rows());
    const Solid right(shapes::join(body, part)), found(mesh);
    EXPECT_NEAR(found.signed_volume_m3(), right.signed_volume_m3(), 1e-12);
    EXPECT_TRUE(found.inside(part.vertices_m.colwise().mean().transpose()));
  }
  // All inside out and one part right: the large ones decide, and then the small one is turned back.
  EXPECT_NEAR(Solid(shapes::join(turned(body), beside)).signed_volume_m3(), Solid(shapes::join(body, beside)).signed_volume_m3(), 1e-12);
  EXPECT_EQ(orient(shapes::join(body, turned(within))).flipped, 0) << "a cavity";
  EXPECT_FALSE(Solid(shapes::join(body, turned(within))).inside(Vec3::Zero()));
}

// Where many places are finer, the cells elsewhere grow to keep the count; a solid bar is no thin shell for that.
TEST(Tetrahedralise, a_bar_that_is_finer_under_its_tool_and_at_its_foot_is_filled) {
  const TriMesh m = lab::box_surface({0.56, -0.04, 0}, {0.64, 0.04, 0.16}, 20);
  for (const Vec3& contact : {Vec3(0.617816, -0.04, 0.0617312), Vec3(0.608535, -0.04, 0.0606342), Vec3(0.64, 0.04, 0.16)}) {
    TetrahedraliseOptions o;
    o.tetrahedra = 8000;
    o.finer = finer_at_feet({Vec3::Zero(), Vec3::UnitZ()}, m);
    for (FinerNear& near : o.finer) near.edge_m *= 5.0 / 6;
    ASSERT_GT(o.finer.size(), 50u);
    o.finer.insert(o.finer.begin(), {contact, 0.0225, 0.003});
    const auto r = tetrahedralise(m, o);
    EXPECT_EQ(r.check.inverted + r.check.degenerate, 0);
    EXPECT_GE(r.check.min_dihedral_deg, 10);  // beside a foot's edge: below what bodies without such places keep
    EXPECT_NEAR(r.check.tetrahedra, o.tetrahedra, 0.2 * o.tetrahedra);
    EXPECT_LT(std::abs(r.volume_error.value_or(1)), 0.005);
  }
}

TEST(Tetrahedralise, is_finer_where_asked) {
  TetrahedraliseOptions o;
  o.edge_m = 0.02;
  o.finer = {{Vec3(0, 0, 0.05), 0.01, 0.004}};
  const auto r = tetrahedralise(shapes::sphere(0.05, 4), o);
  expect_usable(r);
  double near_sum = 0, far_sum = 0;
  int near_count = 0, far_count = 0;
  for (Index i = 0; i < r.mesh.tetrahedra.rows(); ++i) {
    const Vec3 a = r.mesh.nodes_m.row(r.mesh.tetrahedra(i, 0)).transpose(),
               b = r.mesh.nodes_m.row(r.mesh.tetrahedra(i, 1)).transpose();
    if ((a - o.finer[0].point_m).norm() < 0.01) near_sum += (a - b).norm(), ++near_count;
    if (a.z() < 0) far_sum += (a - b).norm(), ++far_count;
  }
  ASSERT_GT(near_count, 20);
  ASSERT_GT(far_count, 20);
  EXPECT_LT(near_sum / near_count, 0.005);
  EXPECT_GT(far_sum / far_count, 0.01);
}

TEST(Tetrahedralise, refuses_what_has_no_inside) {
  const TriMesh plane = shapes::make({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}});
  EXPECT_THAT(message_of([&] { tetrahedralise(plane); }), HasSubstr("encloses nothing"));
  std::vector<Vec3> waves;  // hollow on both sides here and there
  std::vector<std::array<Index, 3>> sheet;
  constexpr Index n = 30;
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < n; ++j) {
      waves.emplace_back(0.1 * i / n, 0.1 * j / n, 0.02 * std::sin(6.0 * i / n) * std::cos(5.0 * j / n));
      const Index a = n * i + j;
      if (i + 1 < n && j + 1 < n) sheet.insert(sheet.end(), {{a, a + n, a + 1}, {a + 1, a + n, a + n + 1}});
    }
  EXPECT_THAT(message_of([&] { tetrahedralise(shapes::make(waves, sheet)); }), HasSubstr("encloses nothing"));
  EXPECT_THAT(message_of([&] {
                tetrahedralise(shapes::make({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}));
              }),
              HasSubstr("no triangle with an area"));
  EXPECT_THAT(message_of([&] { tetrahedralise(TriMesh{}); }), HasSubstr("no triangle"));
}

TEST(Tetrahedralise, warns_of_units_and_closed_holes) {
  TriMesh m = shapes::sphere(80, 4);
  const auto z = [&](Index t) { return m.vertices_m(m.triangles(t, 0), 2); };
  Index n = 0;
  for (Index t = 0; t < m.triangles.rows(); ++t)
    if (z(t) < 40) m.triangles.row(n++) = Eigen::Matrix<Index, 1, 3>(m.triangles.row(t));
  m.triangles.conservativeResize(n, 3);
  const auto r = with(m, 1500);
  EXPECT_THAT(r.warnings, Contains(Field(&Finding::message, HasSubstr("millimetres?"))));
  EXPECT_THAT(r.warnings, Contains(Field(&Finding::code, "closed_holes")));
  EXPECT_GT(r.unseen_share, 0.1);
  EXPECT_LT(r.unseen_share, 0.35);
}

TEST(Tetrahedralise, options_are_checked_field_by_field) {
  const TriMesh m = shapes::sphere(0.05, 2);
  const auto bad = [&](auto change) {
    TetrahedraliseOptions o;
    change(o);
    return message_of([&] { tetrahedralise(m, o); });
  };
  EXPECT_THAT(bad([](auto& o) { o.tetrahedra = 3; }), HasSubstr("tetrahedra"));
  EXPECT_THAT(bad([](auto& o) { o.edge_m = -1; }), HasSubstr("edge_m"));
  EXPECT_THAT(bad([](auto& o) { o.detail = 0; }), HasSubstr("detail"));
  EXPECT_THAT(bad([](auto& o) { o.finest = 0; }), HasSubstr("finest"));
  EXPECT_THAT(bad([](auto& o) { o.finer = {{Vec3(NAN, 0, 0), 1, 1}}; }), HasSubstr("finer.point_m"));
  EXPECT_THAT(bad([](auto& o) { o.finer = {{Vec3::Zero(), -1, 1}}; }), HasSubstr("finer.radius_m"));
  EXPECT_THAT(bad([](auto& o) { o.finer = {{Vec3::Zero(), 1, 0}}; }), HasSubstr("finer.edge_m"));
}

TEST(Tetrahedralise, edges_that_would_take_millions_of_tetrahedra_are_refused_at_once) {
  const TriMesh ball = shapes::sphere(0.1, 4);
  const auto said = [&](const TetrahedraliseOptions& o) -> std::string {
    try {
      tetrahedralise(ball, o);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing";
  };
  TetrahedraliseOptions tiny, large, fine_spot;
  tiny.edge_m = 1e-6;
  large.edge_m = 10;
  fine_spot.finer = {{Vec3(0, 0, 0.1), 0.05, 1e-6}};
  EXPECT_THAT(said(tiny), AllOf(HasSubstr("edge_m"), HasSubstr("1e-06 m take some")));
  EXPECT_THAT(said(large), AllOf(HasSubstr("edge_m"), HasSubstr("longer than the object")));
  EXPECT_THAT(said(fine_spot), HasSubstr("finer.edge_m"));
}

/// What is lost is said, with its place.
TEST(Tetrahedralise, parts_that_are_left_out_and_vertices_that_stray_are_named) {
  TriMesh two = shapes::sphere(0.1, 4);
  const TriMesh small = shapes::sphere(0.008, 3);
  const Eigen::Index vertices = two.vertices_m.rows(), triangles = two.triangles.rows();
  two.vertices_m.conservativeResize(vertices + small.vertices_m.rows(), 3);
  two.vertices_m.bottomRows(small.vertices_m.rows()) = small.vertices_m.rowwise() + Eigen::RowVector3d(0.3, 0, 0);
  two.triangles.conservativeResize(triangles + small.triangles.rows(), 3);
  two.triangles.bottomRows(small.triangles.rows()) = small.triangles.array() + static_cast<Index>(vertices);
  TetrahedraliseOptions o;
  o.tetrahedra = 3000;
  std::string said;
  for (const Finding& one : tetrahedralise(two, o).warnings) said += one.code + ": " + one.message + "\n";
  EXPECT_THAT(said, AllOf(HasSubstr("dropped_pieces"), HasSubstr("parts of their own"), HasSubstr("(0.3, "), HasSubstr("surface_distance")));

  TriMesh stray = shapes::sphere(0.1, 4);
  stray.vertices_m(5, 0) = 1;
  said.clear();
  for (const Finding& one : tetrahedralise(stray, o).warnings) said += one.code + ": " + one.message + "\n";
  EXPECT_THAT(said, AllOf(HasSubstr("surface_distance"), HasSubstr("stray vertices")));
}

TEST(Tetrahedralise, can_be_cancelled) {
  int calls = 0;
  const auto r = tetrahedralise(shapes::sphere(0.05, 3), {}, [&](std::string_view, double) { return ++calls < 3; });
  EXPECT_TRUE(r.cancelled);
  EXPECT_EQ(r.check.inverted, 0);
}

}  // namespace
}  // namespace palpate::geometry::tetrahedralise_test
