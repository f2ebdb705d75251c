// label: data
// SPDX-License-Identifier: Apache-2.0
// Meshes of the optional data folder: scans and models with pinched vertices, holes and flipped parts.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "palpate/geometry/tetrahedralise.hpp"
#include "palpate/io/mesh_file.hpp"

namespace palpate::geometry::shared_meshes_test {
namespace {

struct Case {
  const char* name;
  Index tetrahedra;
  double rms, hausdorff;  ///< shares of the diagonal
};

class SharedMesh : public testing::TestWithParam<Case> {};

TEST_P(SharedMesh, becomes_usable_tetrahedra) {
  const std::filesystem::path file =
      std::filesystem::path(PALPATE_SHARED_DIR) / "data/meshes" / (std::string(GetParam().name) + ".obj");
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no data folder: " << file;
  TetrahedraliseOptions o;
  o.tetrahedra = GetParam().tetrahedra;
  const auto r = tetrahedralise(io::read_tri_mesh(file), o);
  EXPECT_EQ(r.check.inverted + r.check.degenerate, 0);
  EXPECT_EQ(r.check.non_manifold_boundary_edges, 0);
  EXPECT_GE(r.check.min_dihedral_deg, 15);
  EXPECT_LE(r.check.max_dihedral_deg, 150);
  EXPECT_EQ(r.check.components, 1);
  if (r.volume_error) {
    EXPECT_LT(std::abs(*r.volume_error), o.tetrahedra < 6000 ? 0.02 : 0.01);
  }
  EXPECT_LT(r.surface_rms_m, GetParam().rms * r.surface.diagonal_m());
  EXPECT_LT(r.hausdorff_m, GetParam().hausdorff * r.surface.diagonal_m());
}

INSTANTIATE_TEST_SUITE_P(
    All, SharedMesh,
    testing::Values(Case{"armadillo_lowres", 3000, 0.0025, 0.02}, Case{"armadillo_lowres", 12000, 0.0012, 0.01},
                    Case{"bunny_manifold", 3000, 0.0025, 0.02}, Case{"bunny_manifold", 12000, 0.0012, 0.01},
                    Case{"bunny_stanford", 3000, 0.0025, 0.02}, Case{"bunny_stanford", 12000, 0.0012, 0.0125},
                    Case{"teddy_autoknit", 3000, 0.0025, 0.02}, Case{"teddy_autoknit", 12000, 0.0012, 0.01},
                    // self-intersecting; its ears, horns and tail are thinner than the rest's edges
                    Case{"cow_viewpoint", 3000, 0.0025, 0.02}, Case{"cow_viewpoint", 12000, 0.0012, 0.01}),
    [](const auto& i) { return std::string(i.param.name) + "_" + std::to_string(i.param.tetrahedra); });

}  // namespace
}  // namespace palpate::geometry::shared_meshes_test
