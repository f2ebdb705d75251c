// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The pressed cube in CalculiX: the same distorted mesh, law and nodal forces (10 N on a disc of 25 mm radius, a quarter of
// E in pressure), C3D4 and C3D10, linear and NLGEOM with its Neo-Hookean law, node by node.
#include "calculix.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <utility>

#include "fem_meshes.hpp"
#include "palpate/fem/regions.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem::calculix_test {
namespace {

struct Case {
  int nodes;
  bool nonlinear;
  double poisson;
};

class CalculiX : public testing::TestWithParam<Case> {};

TEST_P(CalculiX, AgreesNodeByNode) {
  if (!calculix_is_there()) GTEST_SKIP() << "CalculiX (ccx) is not installed";
  const Case c = GetParam();
  TetMesh mesh = distorted(block_mesh(6, 6, 6, {0.15, 0.15, 0.15}), 0.004, 21);
  if (c.nodes == 10) mesh = to_quadratic(mesh);
  const std::vector<Index> held = nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; });
  Boundary b;
  b.constraints = clamp(held);
  b.forces = spread_over_patch(mesh, {0.075, 0.075, 0.15}, 0.025);
  const Vec3 force = 10 * Vec3(0.2, -0.1, -1).normalized();
  const double young = 20000;
  const VectorX theirs = calculix_displacements(mesh, held, b.forces * force, c.nonlinear, young, c.poisson);
  ASSERT_TRUE(theirs.allFinite()) << "ccx gave no result";
  const Equilibrium e =
      Statics(mesh, c.nonlinear ? "neo_hookean_isochoric" : "linear", b).solve(young, c.poisson, force, VectorX());
  ASSERT_TRUE(e.converged) << e.reason;
  const double largest = e.displacement_m.cwiseAbs().maxCoeff();
  EXPECT_GT(largest, 2e-3);
  const double difference = (theirs - e.displacement_m).cwiseAbs().maxCoeff() / largest;
  RecordProperty("largest_difference", std::to_string(1e6 * difference) + "e-6");
  EXPECT_LT(difference, 2e-6);  // its file carries seven digits
}

// The upper part of the cube is of another stiffness, and of another nu, up to a slanted face through its middle.
TEST_P(CalculiX, AgreesWithTwoMaterials) {
  if (!calculix_is_there()) GTEST_SKIP() << "CalculiX (ccx) is not installed";
  const Case c = GetParam();
  TetMesh mesh = distorted(block_mesh(4, 4, 4, {0.15, 0.15, 0.15}), 0.006, 22);
  if (c.nodes == 10) mesh = to_quadratic(mesh);
  const std::vector<Index> held = nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; });
  Boundary b;
  b.constraints = clamp(held);
  b.forces = spread_over_patch(mesh, {0.075, 0.075, 0.15}, 0.03);
  const Vec3 force = 8 * Vec3(0.2, -0.1, -1).normalized();
  const double young = 20000;
  StaticsOptions options;
  std::vector<Index> upper;
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
    const Vec3 at = element_centre(mesh, e);
    options.region.push_back(at.z() > 0.05 + 0.4 * at.x() ? 1 : 0);
    if (options.region.back() == 1) upper.push_back(e);
  }
  const std::optional<double> shared;
  for (const auto& [ratio, upper_poisson] : {std::pair(5.0, shared), std::pair(0.4, shared), std::pair(0.4, std::optional(0.1)),
                                             std::pair(2.0, std::optional(0.48))}) {
    options.region_stiffness = Eigen::Vector2d(1, ratio);
    if (upper_poisson) options.region_poisson = Eigen::Vector2d(std::nan(""), *upper_poisson);
    const VectorX theirs =
        calculix_displacements(mesh, held, b.forces * force, c.nonlinear, young, c.poisson,
                               {{upper, ratio * young, upper_poisson.value_or(c.poisson)}});
    ASSERT_TRUE(theirs.allFinite()) << "ccx gave no result";
    const Equilibrium e = Statics(mesh, c.nonlinear ? "neo_hookean_isochoric" : "linear", b, options)
                              .solve(young, c.poisson, force, VectorX());
    ASSERT_TRUE(e.converged) << e.reason;
    const double largest = e.displacement_m.cwiseAbs().maxCoeff();
    EXPECT_GT(largest, 5e-4);
    EXPECT_LT((theirs - e.displacement_m).cwiseAbs().maxCoeff(), 3e-6 * largest) << "ratio " << ratio << ", nu " << upper_poisson.value_or(c.poisson);
  }
}

std::vector<Case> cases() {
  std::vector<Case> all;
  for (int nodes : {4, 10})
    for (bool nonlinear : {false, true})
      for (double poisson : {0.3, 0.45, 0.499}) all.push_back({nodes, nonlinear, poisson});
  return all;
}

INSTANTIATE_TEST_SUITE_P(Elements, CalculiX, testing::ValuesIn(cases()), [](const auto& each) {
  return "C3D" + std::to_string(each.param.nodes) + (each.param.nonlinear ? "_neo_hooke_" : "_linear_") +
         std::to_string(static_cast<int>(1000 * each.param.poisson + 0.5));
});

}  // namespace
}  // namespace palpate::fem::calculix_test
