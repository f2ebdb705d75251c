// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The mesh under the tool and the error that it says it has, against the converged solution of the pressed cube (0.15 m,
// bottom held, disc pressure; graded quadratic meshes of another mesher solved by CalculiX).
#include "palpate/fem/discretisation.hpp"

#include <gtest/gtest.h>

#include <array>

#include "fem_meshes.hpp"

namespace palpate::fem::discretisation_test {
namespace {

struct Disc {
  double radius, poisson, mean_depth_m;  // at 30 N, E = 20 kPa
};

class PressedCube : public testing::TestWithParam<Disc> {};
INSTANTIATE_TEST_SUITE_P(Discs, PressedCube,
                         testing::Values(Disc{0.025, 0.3, 2.8711e-2}, Disc{0.025, 0.45, 2.5861e-2},
                                         Disc{0.010, 0.3, 7.2780e-2}));

TEST_P(PressedCube, DepthIsRightToOnePercentAndTheErrorIsKnown) {
  const Disc disc = GetParam();
  const TetMesh base = block_mesh(6, 6, 6, {0.15, 0.15, 0.15});
  const Vec3 contact(0.075, 0.075, 0.15);
  const auto boundary = [&](const TetMesh& mesh, const RefinedMesh&) {
    Boundary b;
    b.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
    b.forces = spread_over_patch(mesh, contact, disc.radius);
    return b;
  };
  DiscretisationOptions options;
  options.poisson_ratio = disc.poisson;
  options.tolerance = 0.012;
  const Discretisation d = discretise(base, contact, disc.radius, boundary, Vec3(0, 0, -30), options);
  EXPECT_TRUE(d.tolerance_met);
  const auto depth = [&](const TetMesh& mesh, const RefinedMesh& linear) {
    const Boundary b = boundary(mesh, linear);
    const Eigen::SparseMatrix<double> forces = b.forces;
    const Equilibrium e = Statics(mesh, "linear", b).solve(20000, disc.poisson, Vec3(0, 0, -30), VectorX());
    return -(forces.col(2).transpose() * e.displacement_m).value();
  };
  const double error = depth(d.mesh, d.linear) / disc.mean_depth_m - 1;
  EXPECT_LT(std::abs(error), 0.01);
  EXPECT_GT(d.young_error, 0.5 * std::abs(error) - 0.002);  // the references are good to 0.1 %
  EXPECT_LT(d.young_error, 4 * std::abs(error) + 0.005);
  const double base_error = std::abs(depth(to_quadratic(base), {base, {}}) / disc.mean_depth_m - 1);
  EXPECT_GT(base_error, 0.03);
  EXPECT_GT(d.base_young_error, 0.5 * base_error);
  EXPECT_LT(d.base_young_error, 2 * base_error);
  RecordProperty("nodes", static_cast<int>(d.mesh.nodes_m.rows()));
  RecordProperty("error_percent", std::to_string(100 * error));
  RecordProperty("estimated_percent", std::to_string(100 * d.young_error));
  RecordProperty("base_error_percent", std::to_string(100 * base_error));
  RecordProperty("base_estimated_percent", std::to_string(100 * d.base_young_error));
  RecordProperty("levels", d.levels);
}

// Two depths that hardly differ say little by themselves: by chance, as long as the contact that was found still grows; if that has
// come to rest, it is the base mesh's change that says nothing.
TEST(DiscretisationError, IsBelievedToBeSmallWhereTheContactCameToRest) {
  const TetMesh base = block_mesh(2, 2, 2, {0.1, 0.1, 0.1});
  const ContactPatch patch{{0.05, 0.05, 0.1}, 0.03, Vec3::Zero()};
  const auto error = [&](const std::array<double, 3>& depth_mm, const std::array<double, 3>& area_mm2) {
    std::size_t level = 0;
    const Discretisation d = discretise(base, patch, [&](const TetMesh& mesh, const RefinedMesh&) {
      const std::size_t at = level++;
      return ContactAnswer{1e-3 * depth_mm[at], VectorX::Ones(3 * mesh.nodes_m.rows()), 0, 1e-6 * area_mm2[at]};
    });
    EXPECT_EQ(d.levels, 2);
    return d.young_error;
  };
  const std::array<double, 3> agree{3.0, 4.0, 4.001};
  const double by_chance = error(agree, {50, 80, 88}), settled = error(agree, {50, 80, 80.4}), unknown = error(agree, {0, 0, 0});
  EXPECT_EQ(by_chance, unknown);
  EXPECT_GT(by_chance, 0.005);
  EXPECT_LT(settled, 0.3 * by_chance);
  EXPECT_GT(settled, 0.001 / 4 / 3) << "more than what the second change promises at order two";
  // Where the changes fall no faster than the order allows, the area has no say.
  const std::array<double, 3> fall{3.6, 3.9, 3.98};
  EXPECT_EQ(error(fall, {50, 80, 80.4}), error(fall, {50, 80, 88}));
}

TEST(RefineNear, KeepsVolumeOrientationAndConformity) {
  const TetMesh base = distorted(block_mesh(3, 3, 3, {0.1, 0.1, 0.1}), 0.006, 8);
  const RefinedMesh fine = refine_near(base, {0.05, 0.05, 0.1}, 0.01, 0.005);
  EXPECT_GT(fine.mesh.nodes_m.rows(), 2 * base.nodes_m.rows());
  EXPECT_NEAR(volume(fine.mesh), 1e-3, 1e-15);
  // A hanging node would show as a boundary face inside the body.
  const Triangles faces = boundary_triangles(fine.mesh);
  double area = 0;
  for (Index f = 0; f < faces.rows(); ++f) {
    const Vec3 a = node_position(fine.mesh, faces(f, 0)), b = node_position(fine.mesh, faces(f, 1)),
               c = node_position(fine.mesh, faces(f, 2));
    area += 0.5 * (b - a).cross(c - a).norm();
  }
  EXPECT_NEAR(area, 0.06, 1e-12);
  Boundary b;
  b.inertia_relief = true;
  EXPECT_NO_THROW(Statics(fine.mesh, "linear", b));  // no element is inside out
  // Held nodes stay held: the bottom of the base mesh, refined, is the bottom of the refined mesh.
  const auto bottom = [](const TetMesh& m) { return nodes_where(m, [](const Vec3& x) { return x.z() < 1e-9; }); };
  const RefinedMesh low = refine_near(base, {0.05, 0.05, 0}, 0.02, 0.01);
  std::vector<Index> extended = extend_nodes(bottom(base), low);
  std::sort(extended.begin(), extended.end());
  EXPECT_EQ(extended, bottom(low.mesh));
}

}  // namespace
}  // namespace palpate::fem::discretisation_test
