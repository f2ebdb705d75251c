// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/boundary.hpp"

#include <gtest/gtest.h>

#include "fem_meshes.hpp"
#include "palpate/core/error.hpp"

namespace palpate::fem::boundary_test {
namespace {

VectorX shares(const Eigen::SparseMatrix<double>& columns) {
  const VectorX x = columns.col(0);
  return Eigen::Map<const Points>(x.data(), x.size() / 3, 3).col(0);
}

class Patch : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Elements, Patch, testing::Values(4, 10));

// Resultant, point of attack and second moment of a disc, wherever it lies between the nodes.
TEST_P(Patch, SpreadsLikeADisc) {
  TetMesh mesh = block_mesh(5, 5, 2, {0.1, 0.1, 0.04});
  if (GetParam() == 10) mesh = to_quadratic(mesh);
  const Vec3 centre(0.043, 0.057, 0.04);
  const double radius = 0.013;
  const VectorX share = shares(spread_over_patch(mesh, centre, radius));
  EXPECT_NEAR(share.sum(), 1, 1e-12);
  Vec3 middle = Vec3::Zero();
  double second = 0;
  for (Index i = 0; i < share.size(); ++i) {
    const Vec3 x = node_position(mesh, i);
    middle += share(i) * x;
    second += share(i) * (x - centre).squaredNorm();
    if (share(i) != 0) {
      EXPECT_NEAR(x.z(), 0.04, 1e-12);
    }
  }
  EXPECT_LT((middle - centre).norm(), 2e-3 * radius);
  // Quadratic shape functions carry x^2 exactly; linear ones spread it over a cell.
  if (GetParam() == 10) {
    EXPECT_NEAR(second, 0.5 * radius * radius, 2e-3 * radius * radius);
  }
}

// Of the same resultant and middle, with the second moment of 1 / sqrt(1 - r^2 / a^2): two thirds of a^2, where a disc's is a half.
TEST(Patch, OfAPunchIsHeavierAtTheRim) {
  const TetMesh mesh = to_quadratic(block_mesh(8, 8, 2, {0.1, 0.1, 0.04}));
  const Vec3 centre(0.043, 0.057, 0.04);
  for (const double radius : {0.013, 0.021}) {
    const VectorX share = shares(spread_over_patch(mesh, {centre, radius, Vec3::Zero(), Pressure::punch}));
    EXPECT_NEAR(share.sum(), 1, 1e-12);
    Vec3 middle = Vec3::Zero();
    double second = 0;
    for (Index i = 0; i < share.size(); ++i) {
      middle += share(i) * node_position(mesh, i);
      second += share(i) * (node_position(mesh, i) - centre).squaredNorm();
    }
    EXPECT_LT((middle - centre).norm(), 2e-3 * radius);
    EXPECT_NEAR(second / (radius * radius), 2.0 / 3, 4e-3);
  }
}

TEST(Patch, LeavesTheFarSideOfAThinPlateAlone) {
  const TetMesh mesh = block_mesh(10, 10, 1, {0.1, 0.1, 0.005});
  const VectorX share = shares(spread_over_patch(mesh, {0.05, 0.05, 0.005}, 0.02));
  for (Index i = 0; i < share.size(); ++i)
    if (node_position(mesh, i).z() < 1e-9) {
      EXPECT_EQ(share(i), 0);
    }
  EXPECT_THROW(spread_over_patch(mesh, {0.05, 0.05, 0.1}, 0.02), Error);
  EXPECT_THROW(spread_over_patch(mesh, {0.05, 0.05, 0.005}, 0), Error);
}

TEST(Mesh, FacesPointOutwardsAndEncloseTheVolume) {
  for (const TetMesh& mesh : {block_mesh(2, 3, 2, {0.1, 0.2, 0.3}), to_quadratic(block_mesh(2, 3, 2, {0.1, 0.2, 0.3}))}) {
    const Triangles t = boundary_triangles(mesh);
    double enclosed = 0;
    for (Index f = 0; f < t.rows(); ++f)
      enclosed += node_position(mesh, t(f, 0)).dot(node_position(mesh, t(f, 1)).cross(node_position(mesh, t(f, 2)))) / 6;
    EXPECT_NEAR(enclosed, 0.006, 1e-14);
    EXPECT_NEAR(volume(mesh), 0.006, 1e-14);
  }
}

TEST(Mesh, RefinementKeepsVolumeAndOrientation) {
  const TetMesh coarse = distorted(block_mesh(2, 2, 2, {0.1, 0.1, 0.1}), 0.01, 9);
  const TetMesh fine = refine_uniform(coarse);
  EXPECT_EQ(fine.tetrahedra.rows(), 8 * coarse.tetrahedra.rows());
  EXPECT_NEAR(volume(fine), volume(coarse), 1e-15);
  EXPECT_NO_THROW(Statics(fine, "linear", [&] {
    Boundary b;
    b.inertia_relief = true;
    return b;
  }()));
}

TEST(Mesh, InsideOutElementsAndFreeMotionsAreNamed) {
  TetMesh mesh = block_mesh(2, 2, 2, {0.1, 0.1, 0.1});
  Boundary b;
  b.constraints = clamp({0});
  try {
    Statics(mesh, "linear", b);
    FAIL() << "one held node leaves three rotations";
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("rotation about"), std::string::npos) << e.what();
  }
  std::swap(mesh.tetrahedra(3, 0), mesh.tetrahedra(3, 1));
  try {
    Statics(mesh, "linear", b);
    FAIL() << "an inside-out element went unnoticed";
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("row 3"), std::string::npos) << e.what();
  }
}

TEST(Support, IsChosenByVerticesBoxOrPlane) {
  const TetMesh mesh = block_mesh(2, 2, 2, {0.1, 0.1, 0.1});
  Support s;
  s.kind = SupportKind::plane;
  EXPECT_EQ(support_nodes(mesh, s).size(), 9u);
  s.kind = SupportKind::box;
  s.box_max_m = Vec3(0.1, 0.1, 0.05);
  EXPECT_EQ(support_nodes(mesh, s).size(), 18u);
  s.kind = SupportKind::vertices;
  s.vertices = {0, 1, 3, 4};
  EXPECT_EQ(support_nodes(mesh, s).size(), 4u);
  EXPECT_GT(support_nodes(to_quadratic(mesh), s).size(), 4u);
  s.vertices = {};
  s.name = "table";
  try {
    support_nodes(mesh, s);
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("table"), std::string::npos);
  }
}

}  // namespace
}  // namespace palpate::fem::boundary_test
