// label: oracle
// SPDX-License-Identifier: Apache-2.0
// Bodies that are too large to factorise at every step: conjugate gradients inside Newton's method. The pressed cube against
// Vega FEM's exact co-rotational model on the same meshes; derivatives against differences; a body that loses stability.
#include <gtest/gtest.h>

#include "fem_meshes.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem::large_body_test {
namespace {

constexpr double kYoung = 20e3;

struct Cube {
  explicit Cube(int cells) : mesh(block_mesh(cells, cells, cells, {0.15, 0.15, 0.15}, 1)) {
    boundary.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
    boundary.forces = spread_over_patch(mesh, {0.075, 0.075, 0.15}, 0.025);
    options.residual_tolerance = 1e-10;
  }
  double mean_depth(const Equilibrium& e) const { return -(boundary.forces.col(2).transpose() * e.displacement_m).value(); }
  TetMesh mesh;
  Boundary boundary;
  StaticsOptions options;
};

// 10 985 and 98 415 tetrahedra; the other program's disc is sampled coarser (60 points across).
TEST(LargeBody, CorotationalCubeMeetsVega) {
  for (const auto& [cells, reference_m] : {std::pair{13, 9.811526e-3}, std::pair{27, 1.100860e-2}}) {
    const Cube cube(cells);
    const Equilibrium e =
        Statics(cube.mesh, "corotational", cube.boundary, cube.options).solve(kYoung, 0.3, Vec3(0, 0, -10), VectorX());
    ASSERT_TRUE(e.converged) << e.reason;
    EXPECT_NEAR(cube.mean_depth(e), reference_m, 5e-4 * reference_m);
    EXPECT_LE(e.newton_steps, 8);  // does not grow with refinement
  }
}

// At half of E in pressure the tangent is not definite on the way: conjugate gradients notice, shifts lead down to a stable
// state with inverted elements under the rim, and both are said.
TEST(LargeBody, LosesStabilityAndSaysSo) {
  const Cube cube(13);
  StaticsOptions options;
  options.residual_tolerance = 1e-8;
  const Statics statics(cube.mesh, "corotational", cube.boundary, options);
  const Equilibrium e = statics.solve(kYoung, 0.3, Vec3(0, 0, -20), VectorX());
  ASSERT_TRUE(e.converged) << e.reason;
  EXPECT_GT(e.factorisations, e.newton_steps);
  EXPECT_TRUE(statics.is_stable(e));
  EXPECT_GT(e.inverted_elements, 0);
  EXPECT_NE(e.reason.find("inside out"), std::string::npos);
  EXPECT_GT(e.pressure_over_young, 0.3);
  RecordProperty("depth_mm", std::to_string(1e3 * cube.mean_depth(e)));
  RecordProperty("steps", e.newton_steps);
}

class LargeBodyLaws : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Laws, LargeBodyLaws, testing::Values("linear", "neo_hookean"),
                         [](const auto& each) { return std::string(each.param); });

// 26 460 unknowns.
TEST_P(LargeBodyLaws, DerivativesAgreeWithDifferences) {
  const Cube cube(20);
  const Statics statics(cube.mesh, GetParam(), cube.boundary, cube.options);
  const Vec3 force(1, 0, -8);
  const Equilibrium at = statics.solve(kYoung, 0.45, force, VectorX());
  ASSERT_TRUE(at.converged) << at.reason;
  EXPECT_LT(at.residual, 1e-9);
  const Sensitivity s = statics.sensitivity(at);
  const auto check = [&](const char* what, double young_step, double poisson_step, const Vec3& force_step,
                         const VectorX& exact) {
    const auto solved = [&](double side) {
      const Equilibrium e = statics.solve(kYoung * std::exp(side * young_step), 0.45 + side * poisson_step,
                                          force + side * force_step, VectorX(), &at.displacement_m);
      EXPECT_TRUE(e.converged) << what << ": " << e.reason;
      return e.displacement_m;
    };
    const VectorX difference = (solved(1) - solved(-1)) / 2;
    EXPECT_LT((difference - exact).norm(), 1e-4 * difference.norm()) << what;
  };
  check("log E", 1e-3, 0, Vec3::Zero(), 1e-3 * s.d_log_young);
  check("nu", 0, 1e-4, Vec3::Zero(), 1e-4 * s.d_poisson);
  check("force", 0, 0, Vec3(0.01, 0, 0), 0.01 * s.d_force.col(0));
}

// The same state and derivatives as by factors alone (averaged dilatation always takes them, and does nothing to foam).
TEST(LargeBody, IsTheStateThatFactorsFind) {
  const Cube cube(13);
  StaticsOptions factors = cube.options;
  factors.dilatation = Dilatation::averaged;
  const TetMesh mesh = to_quadratic(block_mesh(6, 6, 6, {0.15, 0.15, 0.15}));
  Boundary b;
  b.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
  b.forces = spread_over_patch(mesh, {0.075, 0.075, 0.15}, 0.025);
  const Statics by_factors(mesh, "foam", b, factors), by_any(mesh, "foam", b, cube.options);
  const Equilibrium one = by_factors.solve(kYoung, 0.2, Vec3(0, 1, -8), VectorX());
  const Equilibrium other = by_any.solve(kYoung, 0.2, Vec3(0, 1, -8), VectorX());
  ASSERT_TRUE(one.converged && other.converged) << one.reason << other.reason;
  EXPECT_LT((one.displacement_m - other.displacement_m).norm(), 1e-8 * one.displacement_m.norm());
  EXPECT_LT((by_factors.sensitivity(one).d_poisson - by_any.sensitivity(other).d_poisson).norm(), 1e-6);
}

}  // namespace
}  // namespace palpate::fem::large_body_test
