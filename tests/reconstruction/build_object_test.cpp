// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/build_object.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/geometry/embedding.hpp"

namespace palpate::reconstruction {
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
}  // namespace palpate::reconstruction
