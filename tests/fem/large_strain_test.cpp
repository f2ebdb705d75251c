// label: oracle
// SPDX-License-Identifier: Apache-2.0
// Loads far beyond small strain: what must converge, what truth says about it, and what is told about states that are odd.
#include <gtest/gtest.h>

#include <random>

#include "fem_meshes.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem::large_strain_test {
namespace {

const double kYoung = 20e3;

class LargeStrain : public testing::TestWithParam<const char*> {
 protected:
  static double poisson() { return std::string(GetParam()) == "foam" ? 0.2 : 0.3; }
  // A cube between plates: the lower one holds, the upper one comes down. Smooth plates leave sideways motion free, with two
  // planes of symmetry.
  static Statics pressed(const TetMesh& mesh, double size_m, bool bonded) {
    Boundary b;
    std::vector<Eigen::Triplet<double>> motion;
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
      const Vec3 x = node_position(mesh, i);
      const bool bottom = x.z()<1e-9, top = x.z()> size_m - 1e-9;
      Constraint c{i, Mat3::Zero(), 0};
      if (top || bottom) c.axes.col(c.count++) = Vec3::UnitZ();
      if ((bonded && (top || bottom)) || (!bonded && x.x() < 1e-9)) c.axes.col(c.count++) = Vec3::UnitX();
      if ((bonded && (top || bottom)) || (!bonded && x.y() < 1e-9)) c.axes.col(c.count++) = Vec3::UnitY();
      if (c.count > 0) b.constraints.push_back(c);
      if (top) motion.emplace_back(3 * i + 2, 0, -1.0);
    }
    b.motions.resize(3 * mesh.nodes_m.rows(), 1);
    b.motions.setFromTriplets(motion.begin(), motion.end());
    return Statics(mesh, GetParam(), b);
  }
};

// Uniaxial stress of the law alone: the lateral stretch that leaves the sides free, by bisection.
double uniaxial_force_n(const MaterialLaw& law, const Moduli& m, double stretch, double area_m2) {
  const auto stress = [&](double lateral) {
    Mat3 p = Mat3::Zero();
    law.energy_and_stress(m, Vec3(lateral - 1, lateral - 1, stretch - 1).asDiagonal(), p);
    return p;
  };
  double low = 0.3, high = 4;
  for (int i = 0; i < 200; ++i) (stress(0.5 * (low + high))(0, 0) < 0 ? low : high) = 0.5 * (low + high);
  return stress(0.5 * (low + high))(2, 2) * area_m2;
}

// Free surfaces of a neo-Hookean body crease from a stretch of 0.44 on (Biot 1963): up to there the block stays homogeneous,
// and its force is that of the law alone; beyond, it finds a state of less energy, which takes less force.
TEST_P(LargeStrain, CubeUnderSmoothPlatesToSixtyPerCent) {
  const TetMesh mesh = to_quadratic(distorted(block_mesh(2, 2, 2, {0.1, 0.1, 0.1}), 0.006, 3));
  const Statics statics = pressed(mesh, 0.1, false);
  const MaterialLaw& law = material_law(GetParam());
  VectorX extra(static_cast<Index>(law.extra_parameters().size()));
  for (Index i = 0; i < extra.size(); ++i) extra(i) = law.extra_parameters()[static_cast<std::size_t>(i)].initial;
  const Moduli m = moduli(kYoung, poisson(), extra);
  for (double travel_m : {0.02, 0.04, 0.06}) {
    const Equilibrium e = statics.solve(kYoung, poisson(), VectorX(0), VectorX::Constant(1, travel_m));
    ASSERT_TRUE(e.converged) << e.reason;
    const double homogeneous_n = -uniaxial_force_n(law, m, 1 - 10 * travel_m, 0.01);
    if (travel_m < 0.05)
      EXPECT_NEAR(e.motion_reaction(0), homogeneous_n, 1e-6 * homogeneous_n) << travel_m;
    else
      EXPECT_LT(e.motion_reaction(0), homogeneous_n * (1 + 1e-6));
    EXPECT_TRUE(statics.is_stable(e)) << travel_m;
  }
}

TEST_P(LargeStrain, BondedCubeToSixtyPerCent) {
  const TetMesh mesh = to_quadratic(block_mesh(3, 3, 3, {0.1, 0.1, 0.1}));
  const Statics statics = pressed(mesh, 0.1, true);
  const Equilibrium e = statics.solve(kYoung, poisson(), VectorX(0), VectorX::Constant(1, 0.06));
  ASSERT_TRUE(e.converged) << e.reason;
  EXPECT_LT(e.residual, 1e-8);
  EXPECT_TRUE(statics.is_stable(e));
  // Where squeezing volume away costs without limit, the force grows faster than the travel. The other two laws let the
  // edges of the plates collapse instead: a state of the equations, and stable.
  const std::string name = GetParam();
  if (name != "neo_hookean" && name != "foam") return;
  EXPECT_EQ(e.inverted_elements, 0);
  const Equilibrium half = statics.solve(kYoung, poisson(), VectorX(0), VectorX::Constant(1, 0.03));
  ASSERT_TRUE(half.converged) << half.reason;
  EXPECT_GT(e.motion_reaction(0), 2 * half.motion_reaction(0));
}

// Elastica: EI theta'' = -n x F of an inextensible line, by shooting with a Runge-Kutta rule of fourth order.
struct Tip {
  double x, z, angle;
};
Tip elastica(double length_m, double stiffness_nm2, double force_x_n, double force_z_n) {
  const int steps = 4000;
  const double h = length_m / steps;
  const auto shoot = [&](double curvature, Tip& tip) {
    double theta = 0, kappa = curvature, x = 0, z = 0;
    const auto bend = [&](double angle) {
      return (force_x_n * std::sin(angle) - force_z_n * std::cos(angle)) / stiffness_nm2;
    };
    for (int i = 0; i < steps; ++i) {
      const double k1 = kappa, l1 = bend(theta), k2 = kappa + h / 2 * l1, l2 = bend(theta + h / 2 * k1);
      const double k3 = kappa + h / 2 * l2, l3 = bend(theta + h / 2 * k2), k4 = kappa + h * l3, l4 = bend(theta + h * k3);
      const double before = theta;
      theta += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
      kappa += h / 6 * (l1 + 2 * l2 + 2 * l3 + l4);
      x += h * std::cos(0.5 * (before + theta));
      z += h * std::sin(0.5 * (before + theta));
    }
    tip = {x, z, theta};
    return kappa;  // zero at a free end
  };
  // The first branch: the smallest curvature (negative: downwards) whose end is free of moment.
  Tip tip{};
  double low = 0, step = -0.05 / length_m, at_low = shoot(low, tip), high = step, at_high = shoot(high, tip);
  while (at_low * at_high > 0) {
    low = high;
    at_low = at_high;
    high += step;
    at_high = shoot(high, tip);
  }
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high), value = shoot(middle, tip);
    (value * at_low > 0 ? low : high) = middle;
  }
  return tip;
}

// The shooting itself against tip positions of the elastica under a transverse load (boundary value problem, PL2/EI = 5).
TEST(Elastica, ShootingAgreesWithTheBoundaryValueProblem) {
  const Tip tip = elastica(1, 1, 0, -5);
  EXPECT_NEAR(-tip.z, 0.71379, 2e-5);
  EXPECT_NEAR(1 - tip.x, 0.38763, 2e-5);
}

TEST_P(LargeStrain, CantileverBentPastNinetyDegrees) {
  const double length_m = 0.4, side_m = 0.02;
  const TetMesh mesh = to_quadratic(block_mesh(30, 2, 2, {length_m, side_m, side_m}));
  Boundary b;
  // The clamp holds the section's plane, not its width: no boundary layer, as in the line's theory.
  for (Index i : nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; })) {
    const Vec3 x = node_position(mesh, i);
    Constraint c{i, Mat3::Zero(), 1};
    c.axes.col(0) = Vec3::UnitX();
    if (std::abs(x.y() - side_m / 2) < 1e-9) c.axes.col(c.count++) = Vec3::UnitY();
    if (std::abs(x.z() - side_m / 2) < 1e-9) c.axes.col(c.count++) = Vec3::UnitZ();
    b.constraints.push_back(c);
  }
  b.forces = spread_over_nodes(static_cast<Index>(mesh.nodes_m.rows()),
                               nodes_where(mesh, [&](const Vec3& x) { return x.x() > length_m - 1e-9; }));
  const Statics statics(mesh, GetParam(), b);
  const double stiffness_nm2 = kYoung * std::pow(side_m, 4) / 12;
  const double unit_n = stiffness_nm2 / (length_m * length_m);
  // Down and back, so that the end turns past the vertical.
  const Vec3 force = unit_n * Vec3(-3, 0, -4);
  const Equilibrium e = statics.solve(kYoung, poisson(), force, VectorX(0));
  ASSERT_TRUE(e.converged) << e.reason;
  EXPECT_EQ(e.inverted_elements, 0);
  const Tip tip = elastica(length_m, stiffness_nm2, force.x(), force.z());
  EXPECT_LT(tip.angle, -EIGEN_PI / 2);
  const Index end = nearest_node(mesh, {length_m, side_m / 2, side_m / 2});
  EXPECT_NEAR(length_m + e.displacement_m(3 * end), tip.x, 0.01 * length_m);
  EXPECT_NEAR(e.displacement_m(3 * end + 2), tip.z, 0.01 * length_m);
}

// From a start whose elements are turned inside out the same state is found as from rest.
TEST_P(LargeStrain, InvertedElementsRecover) {
  const TetMesh mesh = to_quadratic(block_mesh(2, 2, 2, {0.1, 0.1, 0.1}));
  const Statics statics = pressed(mesh, 0.1, true);
  const VectorX travel = VectorX::Constant(1, 0.02);
  const Equilibrium rest = statics.solve(kYoung, poisson(), VectorX(0), travel);
  ASSERT_TRUE(rest.converged) << rest.reason;
  VectorX start = rest.displacement_m;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.06, 0.06);
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    const Vec3 x = node_position(mesh, i);
    if (x.z() > 1e-9 && x.z() < 0.1 - 1e-9)
      for (int k = 0; k < 3; ++k) start(3 * i + k) += uniform(random);
  }
  const Equilibrium e = statics.solve(kYoung, poisson(), VectorX(0), travel, &start);
  ASSERT_TRUE(e.converged) << e.reason;
  EXPECT_EQ(e.inverted_elements, 0);
  EXPECT_LT((e.displacement_m - rest.displacement_m).cwiseAbs().maxCoeff(), 1e-8);
}

INSTANTIATE_TEST_SUITE_P(Laws, LargeStrain,
                         testing::Values("neo_hookean", "neo_hookean_stable", "neo_hookean_isochoric", "foam"),
                         [](const auto& each) { return std::string(each.param); });

// A Newton that may take few steps fails on the whole load at once; smaller steps get there, and the state is the same.
TEST(Continuation, ShrinksAFailedStep) {
  const TetMesh mesh = to_quadratic(block_mesh(4, 1, 1, {0.4, 0.05, 0.05}));
  Boundary b;
  b.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; }));
  b.forces = spread_over_nodes(static_cast<Index>(mesh.nodes_m.rows()),
                               nodes_where(mesh, [](const Vec3& x) { return x.x() > 0.4 - 1e-9; }));
  const Vec3 force(0, 0, -0.3);
  const Equilibrium whole = Statics(mesh, "neo_hookean", b).solve(kYoung, 0.3, force, VectorX(0));
  ASSERT_TRUE(whole.converged) << whole.reason;
  StaticsOptions few;
  few.max_newton_steps = 4;
  const Equilibrium stepped = Statics(mesh, "neo_hookean", b, few).solve(kYoung, 0.3, force, VectorX(0));
  ASSERT_TRUE(stepped.converged) << stepped.reason;
  EXPECT_GT(stepped.newton_steps, whole.newton_steps);
  EXPECT_LT((stepped.displacement_m - whole.displacement_m).norm(), 1e-6 * whole.displacement_m.norm());
  // What cannot be reached is a result with a reason.
  few.max_load_steps = 1;
  const Equilibrium given_up = Statics(mesh, "neo_hookean", b, few).solve(kYoung, 0.3, 3 * force, VectorX(0));
  EXPECT_FALSE(given_up.converged);
  EXPECT_NE(given_up.reason.find("% of the load"), std::string::npos) << given_up.reason;
}

}  // namespace
}  // namespace palpate::fem::large_strain_test
