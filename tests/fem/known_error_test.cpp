// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The error that the solver knows: the pressed cube (0.15 m, bottom held, 10 N, E = 20 kPa, nu = 0.3) under the patches of
// spheres and bars of 10, 15 and 25 mm, at automatic settings, against a mesh of half the edge length everywhere and a fifth
// of the base mesh's far from the tool. CalculiX (C3D10) checks that reference.
#include <gtest/gtest.h>

#include "calculix.hpp"
#include "fem_meshes.hpp"
#include "palpate/fem/discretisation.hpp"

namespace palpate::fem::known_error_test {
namespace {

constexpr double kYoung = 20e3, kPoisson = 0.3;
const Vec3 kForce(0, 0, -10);

struct Tool {
  const char* name;
  double radius_m, half_length_m;
  double calculix_depth_m;  ///< converged C3D10 on graded meshes of another mesher; 0: not known
};

struct Answer {
  VectorX displacement_m;
  double depth_m;
};

class KnownError : public testing::TestWithParam<Tool> {
 protected:
  KnownError() : base(block_mesh(6, 6, 6, {0.15, 0.15, 0.15})) {
    patch = {{0.075, 0.075, 0.15}, GetParam().radius_m, {GetParam().half_length_m, 0, 0}};
  }
  Boundary boundary(const TetMesh& mesh) const {
    Boundary b;
    b.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
    b.forces = spread_over_patch(mesh, patch);
    return b;
  }
  Answer solve(const TetMesh& mesh) const {
    const Boundary b = boundary(mesh);
    const Equilibrium e = Statics(mesh, "linear", b).solve(kYoung, kPoisson, kForce, VectorX());
    return {e.displacement_m, -(b.forces.col(2).transpose() * e.displacement_m).value()};
  }
  TetMesh base;
  ContactPatch patch;
};

TEST_P(KnownError, DepthAndSurfaceAreRightAndTheEstimateIsTrue) {
  const Discretisation d = discretise(base, patch, [&](const TetMesh& mesh, const RefinedMesh&) { return boundary(mesh); },
                                      kForce, {.poisson_ratio = kPoisson});
  EXPECT_TRUE(d.tolerance_met);
  const Answer automatic = solve(d.mesh);
  const RefinedMesh fine = refine_near(
      refine_uniform(base), [&](const Vec3& x) { return patch.distance_m(x) - 1.2 * patch.radius_m; }, patch.radius_m / 4,
      0.4, 26000);
  const Answer reference = solve(to_quadratic(fine.mesh));
  if (GetParam().calculix_depth_m > 0) {
    EXPECT_NEAR(reference.depth_m, GetParam().calculix_depth_m, 1e-3 * reference.depth_m);
  }

  const double error = std::abs(automatic.depth_m / reference.depth_m - 1);
  EXPECT_LT(error, 0.01);
  EXPECT_GT(d.young_error, 0.5 * error);
  EXPECT_LT(d.young_error, 4 * error);
  // Corners of the base mesh, which all meshes share: top outside the patch, and sides.
  double difference = 0, size = 0;
  for (Index i : nodes_where(base, [&](const Vec3& x) {
         const bool side = (x.head<2>().array() < 1e-9).any() || (x.head<2>().array() > 0.15 - 1e-9).any();
         return (side || x.z() > 0.15 - 1e-9) && patch.distance_m(x) > patch.radius_m;
       })) {
    const Vec3 u = reference.displacement_m.segment<3>(3 * i);
    difference += (automatic.displacement_m.segment<3>(3 * i) - u).squaredNorm();
    size += u.squaredNorm();
  }
  const double surface_error = std::sqrt(difference / size);
  EXPECT_LT(surface_error, 0.003);
  RecordProperty("corners", static_cast<int>(d.linear.mesh.nodes_m.rows()));
  RecordProperty("reference_corners", static_cast<int>(fine.mesh.nodes_m.rows()));
  RecordProperty("depth_mm", std::to_string(1e3 * reference.depth_m));
  RecordProperty("error_percent", std::to_string(100 * error));
  RecordProperty("estimate_percent", std::to_string(100 * d.young_error));
  RecordProperty("surface_percent", std::to_string(100 * surface_error));
  RecordProperty("surface_change_percent", std::to_string(100 * d.surface_change));
  RecordProperty("base_error_percent",
                 std::to_string(100 * std::abs(solve(to_quadratic(base)).depth_m / reference.depth_m - 1)));
}

// The same refined mesh and patch in CalculiX.
TEST_P(KnownError, RefinedMeshAgreesWithCalculiX) {
  if (!calculix_is_there()) GTEST_SKIP() << "CalculiX (ccx) is not installed";
  const RefinedMesh refined = refine_near(
      base, [&](const Vec3& x) { return patch.distance_m(x) - patch.radius_m; }, patch.radius_m, 1.0, 900);
  const TetMesh mesh = to_quadratic(refined.mesh);
  const Answer ours = solve(mesh);
  const VectorX theirs = calculix_displacements(mesh, nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }),
                                                VectorX(boundary(mesh).forces * kForce), false, kYoung, kPoisson);
  ASSERT_TRUE(theirs.allFinite()) << "ccx gave no result";
  EXPECT_LT((theirs - ours.displacement_m).cwiseAbs().maxCoeff(), 2e-6 * ours.displacement_m.cwiseAbs().maxCoeff());
}

INSTANTIATE_TEST_SUITE_P(Tools, KnownError,
                         testing::Values(Tool{"sphere_10", 0.010, 0, 7.2780e-2 / 3}, Tool{"sphere_15", 0.015, 0, 0},
                                         Tool{"sphere_25", 0.025, 0, 2.8711e-2 / 3}, Tool{"bar_10", 0.010, 0.03, 0},
                                         Tool{"bar_15", 0.015, 0.03, 0}, Tool{"bar_25", 0.025, 0.03, 0}),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace palpate::fem::known_error_test
