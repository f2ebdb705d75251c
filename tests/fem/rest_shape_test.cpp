// label: oracle
// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/rest_shape.hpp"

#include <gtest/gtest.h>

#include <tuple>

#include "fem_meshes.hpp"
#include "palpate/core/error.hpp"

namespace palpate::fem::rest_shape_test {
namespace {

constexpr double kYoung = 20000;

struct Hanging {
  std::vector<Index> held;
  Boundary operator()(const TetMesh& mesh) const {
    Boundary b;
    b.constraints = clamp(held);
    b.forces = body_force(mesh);
    return b;
  }
};

double largest_row(const Points& a) { return a.rowwise().norm().maxCoeff(); }

// Sag with a known stress-free shape, then back: a cantilever whose tip falls by a third of its length (linear: by a tenth,
// no linear body is one that turns further).
TEST(RestShape, RoundTripOfABendingBar) {
  const Vec3 size(0.3, 0.05, 0.05);
  for (const auto& [law, fall, pull] : {std::tuple{"neo_hookean", 0.09, -3.0}, {"linear", 0.02, -0.8}}) {
    const TetMesh rest = to_quadratic(block_mesh(6, 1, 1, size));
    const Hanging loads{nodes_where(rest, [](const Vec3& x) { return x.x() < 1e-9; })};
    const VectorX gravity = 1000 * Vec3(0, 0, pull);
    const Equilibrium sag = Statics(rest, law, loads(rest)).solve(kYoung, 0.3, gravity, VectorX());
    ASSERT_TRUE(sag.converged) << sag.reason;
    TetMesh seen = rest;
    seen.nodes_m += Eigen::Map<const Points>(sag.displacement_m.data(), seen.nodes_m.rows(), 3);
    ASSERT_GT(largest_row(seen.nodes_m - rest.nodes_m), fall);
    const RestShape found = rest_shape(seen, law, loads, kYoung, 0.3, gravity);
    ASSERT_TRUE(found.converged) << found.reason;
    EXPECT_LT(largest_row(found.mesh.nodes_m - rest.nodes_m), 1e-8 * size.norm()) << law;
  }
}

// A bar that hangs from its top and is seen with length L: at small strain its end was higher by rho g L^2 / (2 E).
TEST(RestShape, HangingBarUnderItsOwnWeight) {
  const double length = 0.2, density = 100, g = 9.81, young = 1e6;
  const TetMesh seen = to_quadratic(block_mesh(1, 1, 4, {0.05, 0.05, length}));
  const Hanging loads{nodes_where(seen, [=](const Vec3& x) { return x.z() > length - 1e-9; })};
  const RestShape found = rest_shape(seen, "neo_hookean", loads, young, 0, density * Vec3(0, 0, -g));
  ASSERT_TRUE(found.converged) << found.reason;
  const double expected = density * g * length * length / (2 * young);
  for (Index i = 0; i < seen.nodes_m.rows(); ++i) {
    const double z = length - seen.nodes_m(i, 2);
    const double lift = density * g * (length * z - z * z / 2) / young;
    // Strains are 2e-4.
    EXPECT_NEAR(found.mesh.nodes_m(i, 2) - seen.nodes_m(i, 2), lift, 1e-3 * expected);
  }
}

TEST(RestShape, SaysWhenTheLoadsAreTooLarge) {
  const TetMesh seen = block_mesh(6, 1, 1, {0.3, 0.05, 0.05});
  const Hanging loads{nodes_where(seen, [](const Vec3& x) { return x.x() < 1e-9; })};
  RestShapeOptions options;
  options.max_iterations = 3;  // not enough for a sag of this size
  const RestShape found = rest_shape(seen, "neo_hookean", loads, 2000, 0.3, 1000 * Vec3(0, 0, -9.81), options);
  EXPECT_FALSE(found.converged);
  EXPECT_FALSE(found.reason.empty());
}

}  // namespace
}  // namespace palpate::fem::rest_shape_test
