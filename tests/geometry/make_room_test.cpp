// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/make_room.hpp"

#include <gtest/gtest.h>

#include "palpate/geometry/tet_quality.hpp"

namespace palpate::geometry::make_room_test {
namespace {

double worst_of(const TetMesh& mesh) {
  double worst = 1;
  for (Index t = 0; t < mesh.tetrahedra.rows(); ++t) worst = std::min(worst, tet_quality(mesh, t));
  return worst;
}

/// An octahedron about one inner node, the last one.
struct Octahedron {
  TetMesh mesh;
  Triangles faces;
  Octahedron() {
    mesh.nodes_m.resize(7, 3);
    mesh.nodes_m << 1, 0, 0, 0, 1, 0, -1, 0, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0;
    mesh.tetrahedra.resize(8, 4), faces.resize(8, 3);
    for (int k = 0; k < 4; ++k) {
      faces.row(2 * k) << k, (k + 1) % 4, 4;
      faces.row(2 * k + 1) << (k + 1) % 4, k, 5;
    }
    for (int t = 0; t < 8; ++t) mesh.tetrahedra.row(t) << 6, faces(t, 0), faces(t, 1), faces(t, 2);
  }
};

TEST(MakeRoom, MovesWhatIsInsideAndNotTheBoundary) {
  Octahedron o;
  ASSERT_GT(worst_of(o.mesh), 0.5);
  const Points before = o.mesh.nodes_m;
  o.mesh.nodes_m.row(5) << 0, 0, -0.2;  // laid on a plane that is higher
  const double squeezed = worst_of(o.mesh);
  ASSERT_LT(squeezed, 0.3);
  const Points boundary = o.mesh.nodes_m.topRows(6);
  make_room(o.faces, before, 0.3, o.mesh);
  EXPECT_GT(worst_of(o.mesh), squeezed + 0.1);
  EXPECT_GT(o.mesh.nodes_m(6, 2), 0.05);
  EXPECT_EQ(Points(o.mesh.nodes_m.topRows(6)), boundary);
}

TEST(MakeRoom, LeavesGoodElementsAsTheyAre) {
  Octahedron o;
  const Points before = o.mesh.nodes_m;
  o.mesh.nodes_m.row(5) << 0, 0, -0.95;
  const Points moved = o.mesh.nodes_m;
  make_room(o.faces, before, 0.3, o.mesh);
  EXPECT_EQ(o.mesh.nodes_m, moved);
}

}  // namespace
}  // namespace palpate::geometry::make_room_test
