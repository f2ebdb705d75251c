// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/graded_block.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "refusals.hpp"

namespace palpate::lab::graded_block_test {
namespace {

double smallest_dihedral_deg(const TetMesh& mesh) {
  double smallest = 180;
  for (Eigen::Index t = 0; t < mesh.tetrahedra.rows(); ++t)
    for (int a = 0; a < 4; ++a)
      for (int b = a + 1; b < 4; ++b) {
        std::array<Vec3, 4> p;
        int at = 2;
        for (int k = 0; k < 4; ++k) p[std::size_t(k == a ? 0 : k == b ? 1 : at++)] = mesh.nodes_m.row(mesh.tetrahedra(t, k));
        const Vec3 edge = (p[1] - p[0]).normalized();
        const auto across = [&](const Vec3& q) { return Vec3((q - p[0]) - edge.dot(q - p[0]) * edge).normalized(); };
        smallest = std::min(smallest, std::acos(std::clamp(across(p[2]).dot(across(p[3])), -1.0, 1.0)) * 180 / M_PI);
      }
  return smallest;
}

class Blocks : public testing::TestWithParam<GradedBlockOptions> {};

TEST_P(Blocks, FillTheBlockConformWithoutSlivers) {
  const GradedBlockOptions options = GetParam();
  const TetMesh mesh = graded_block(options);
  double volume = 0, smallest = 1e300;
  std::map<std::array<Index, 3>, int> faces;
  for (Eigen::Index t = 0; t < mesh.tetrahedra.rows(); ++t) {
    const auto p = [&](int c) { return Vec3(mesh.nodes_m.row(mesh.tetrahedra(t, c))); };
    const double six = (p(1) - p(0)).cross(p(2) - p(0)).dot(p(3) - p(0));
    volume += six / 6;
    smallest = std::min(smallest, six);
    for (int skip = 0; skip < 4; ++skip) {
      std::array<Index, 3> face{};
      for (int k = 0, at = 0; k < 4; ++k)
        if (k != skip) face[std::size_t(at++)] = mesh.tetrahedra(t, k);
      std::sort(face.begin(), face.end());
      ++faces[face];
    }
  }
  EXPECT_GT(smallest, 0);
  EXPECT_NEAR(volume / (options.max_m - options.min_m).prod(), 1, 1e-12);
  // Conforming: every face has one or two owners, and those with one lie on the block's six sides.
  double area = 0;
  for (const auto& [face, owners] : faces) {
    ASSERT_LE(owners, 2);
    if (owners == 2) continue;
    const Vec3 a = mesh.nodes_m.row(face[0]), b = mesh.nodes_m.row(face[1]), c = mesh.nodes_m.row(face[2]);
    area += 0.5 * (b - a).cross(c - a).norm();
  }
  const Vec3 size = options.max_m - options.min_m;
  EXPECT_NEAR(area, 2 * (size.x() * size.y() + size.y() * size.z() + size.z() * size.x()), 1e-12);
  EXPECT_GT(smallest_dihedral_deg(mesh), 8.0);
}

GradedBlockOptions whole_block() {
  GradedBlockOptions options;
  options.min_m.y() = -0.075;
  options.contact_m = {0.02, -0.03, 0.15};
  return options;
}
GradedBlockOptions half_block() {
  GradedBlockOptions options;
  options.contact_m = {-0.03, 0, 0.15};
  return options;
}
INSTANTIATE_TEST_SUITE_P(GradedBlock, Blocks, testing::Values(whole_block(), half_block(), GradedBlockOptions{}));

TEST(GradedBlock, ContactIsRound) {
  const GradedBlockOptions options = whole_block();
  const TetMesh mesh = graded_block(options);
  int rim = 0;
  for (const Index n : contact_nodes(mesh, options)) {
    const double radius = (Vec3(mesh.nodes_m.row(n)) - options.contact_m).norm();
    EXPECT_LE(radius, options.contact_radius_m * (1 + 1e-9));
    rim += std::abs(radius - options.contact_radius_m) < 1e-9;
  }
  EXPECT_EQ(rim, 8 * options.cells_in_radius);
}

TEST(GradedBlock, BadOptionsAreRefused) {
  const auto refused = [](auto change) { return refuses([](const auto& o) { graded_block(o); }, half_block(), change); };
  using O = GradedBlockOptions;
  EXPECT_FALSE(refused([](O&) {}));
  EXPECT_TRUE(refused([](O& o) { o.cells_in_radius = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.growth = 0.5; }));
  EXPECT_TRUE(refused([](O& o) { o.largest_cell_m = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.contact_radius_m = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.max_m.x() = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.contact_m.z() = 0.1; }));
  EXPECT_TRUE(refused([](O& o) { o.contact_m.x() = 0.07; }));
}

}  // namespace
}  // namespace palpate::lab::graded_block_test
