// label: contract
// SPDX-License-Identifier: Apache-2.0
// What every law of the material table promises. A new law joins by its line in the table.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "fem_meshes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem::material_contract_test {
namespace {

constexpr double kYoung = 20000, kPoisson = 0.37;

class MaterialContract : public testing::TestWithParam<const MaterialLaw*> {
 protected:
  const MaterialLaw& law() const { return *GetParam(); }
  Moduli at(double young, double poisson) const {
    VectorX extra(static_cast<Index>(law().extra_parameters().size()));
    // Away from the initial value, so that a law that ignores its parameters is found out.
    for (std::size_t i = 0; i < law().extra_parameters().size(); ++i) {
      const auto& p = law().extra_parameters()[i];
      extra(static_cast<Index>(i)) = p.initial + 0.2 * (p.upper - p.initial);
    }
    return moduli(young, poisson, extra);
  }
  Mat3 stress(const Moduli& m, const Mat3& h) const {
    Mat3 p;
    EXPECT_TRUE(std::isfinite(law().energy_and_stress(m, h, p)));
    return p;
  }
  double energy(const Moduli& m, const Mat3& h) const {
    Mat3 p;
    return law().energy_and_stress(m, h, p);
  }
  // Strains of 20 to 30 % with a rotation of half a radian (small-strain laws know no rotation, which they may be given).
  static std::vector<Mat3> gradients() {
    std::vector<Mat3> all;
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(-0.25, 0.25);
    for (int i = 0; i < 12; ++i) {
      Mat3 h;
      for (int k = 0; k < 9; ++k) h(k) = uniform(random);
      const Mat3 r = Eigen::AngleAxisd(0.5, Vec3(1, -2, 0.5).normalized()).toRotationMatrix();
      const Mat3 f = r * (Mat3::Identity() + h);
      if (f.determinant() > 0.3) all.push_back(f - Mat3::Identity());
    }
    return all;
  }
  static Mat3 rotation() { return Eigen::AngleAxisd(1.1, Vec3(0.3, 1, -0.7).normalized()).toRotationMatrix(); }
};

TEST_P(MaterialContract, RestIsFreeOfEnergyAndStress) {
  const Moduli m = at(kYoung, kPoisson);
  EXPECT_NEAR(energy(m, Mat3::Zero()), 0, 1e-12 * kYoung);
  EXPECT_LT(stress(m, Mat3::Zero()).norm(), 1e-12 * kYoung);
}

TEST_P(MaterialContract, StressIsTheDerivativeOfTheEnergy) {
  const Moduli m = at(kYoung, kPoisson);
  for (const Mat3& h : gradients()) {
    const Mat3 p = stress(m, h);
    for (int k = 0; k < 9; ++k) {
      Mat3 d = Mat3::Zero();
      d(k) = 1e-5;
      EXPECT_NEAR(p(k), (energy(m, h + d) - energy(m, h - d)) / 2e-5, 1e-6 * kYoung);
    }
  }
}

TEST_P(MaterialContract, TangentIsTheDerivativeOfTheStressAndSymmetric) {
  const Moduli m = at(kYoung, kPoisson);
  for (const Mat3& h : gradients()) {
    Mat9 c;
    law().tangent(m, h, c);
    EXPECT_LT((c - c.transpose()).norm(), 1e-10 * c.norm());
    for (int k = 0; k < 9; ++k) {
      Mat3 d = Mat3::Zero();
      d(k) = 1e-5;
      const Mat3 difference = (stress(m, h + d) - stress(m, h - d)) / 2e-5;
      for (int i = 0; i < 9; ++i) EXPECT_NEAR(c(i, k), difference(i), 2e-6 * kYoung);
    }
  }
}

TEST_P(MaterialContract, StressIsProportionalToYoungsModulus) {
  for (const Mat3& h : gradients())
    EXPECT_LT((3 * stress(at(kYoung, kPoisson), h) - stress(at(3 * kYoung, kPoisson), h)).norm(), 1e-10 * kYoung);
}

TEST_P(MaterialContract, DerivativesToTheParametersMatchDifferences) {
  const Moduli m = at(kYoung, kPoisson);
  for (const Mat3& h : gradients()) {
    const Mat3 d_poisson = (stress(at(kYoung, kPoisson + 1e-5), h) - stress(at(kYoung, kPoisson - 1e-5), h)) / 2e-5;
    EXPECT_LT((law().stress_d_poisson(m, h) - d_poisson).norm(), 1e-6 * (kYoung + d_poisson.norm()));
    for (Index k = 0; k < m.extra.size(); ++k) {
      Moduli up = m, down = m;
      up.extra(k) += 1e-5;
      down.extra(k) -= 1e-5;
      const Mat3 d = (stress(up, h) - stress(down, h)) / 2e-5;
      EXPECT_LT((law().stress_d_extra(m, h, static_cast<int>(k)) - d).norm(), 1e-6 * (kYoung + d.norm()));
    }
  }
}

TEST_P(MaterialContract, IsObjectiveAndIsotropic) {
  if (law().is_linear()) GTEST_SKIP() << "a small-strain law is not objective, and says so";
  const Moduli m = at(kYoung, kPoisson);
  const Mat3 q = rotation();
  for (const Mat3& h : gradients()) {
    const Mat3 f = Mat3::Identity() + h;
    const Mat3 rotated = q * f - Mat3::Identity(), turned = f * q - Mat3::Identity();
    EXPECT_NEAR(energy(m, rotated), energy(m, h), 1e-9 * kYoung);
    EXPECT_NEAR(energy(m, turned), energy(m, h), 1e-9 * kYoung);
    EXPECT_LT((stress(m, rotated) - q * stress(m, h)).norm(), 1e-8 * kYoung);
  }
}

// What is left when kappa/2 theta^2 is taken off must not grow without bound near nu = 0.5.
TEST_P(MaterialContract, VolumetricPartHoldsWhatLocks) {
  VolumetricPart part;
  const Moduli m = at(kYoung, kPoisson);
  if (!law().volumetric_part(m, Mat3::Zero(), true, part)) GTEST_SKIP() << "meant for compressible bodies";
  EXPECT_EQ(part.theta, 0);
  for (const Mat3& h : gradients()) {
    law().volumetric_part(m, h, true, part);
    for (int k = 0; k < 9; ++k) {
      Mat3 d = Mat3::Zero();
      d(k) = 1e-5;
      VolumetricPart up, down;
      law().volumetric_part(m, h + d, false, up);
      law().volumetric_part(m, h - d, false, down);
      EXPECT_NEAR(part.gradient(k), (up.theta - down.theta) / 2e-5, 1e-6);
      const Mat3 difference = (up.gradient - down.gradient) / 2e-5;
      for (int i = 0; i < 9; ++i) EXPECT_NEAR(part.hessian(i, k), difference(i), 1e-5);
    }
    const Moduli stiff = at(kYoung, 0.49999);
    law().volumetric_part(stiff, h, false, part);
    EXPECT_LT((stress(stiff, h) - part.modulus * part.theta * part.gradient).norm(), 20 * kYoung);
    VolumetricPart up, down;
    law().volumetric_part(at(kYoung, kPoisson + 1e-5), h, false, up);
    law().volumetric_part(at(kYoung, kPoisson - 1e-5), h, false, down);
    law().volumetric_part(m, h, false, part);
    EXPECT_NEAR(part.modulus_d_poisson, (up.modulus - down.modulus) / 2e-5, 1e-5 * part.modulus_d_poisson);
  }
}

TEST_P(MaterialContract, SmallStrainsAreNotLostInRounding) {
  const Moduli m = at(kYoung, kPoisson);
  Mat3 h;
  h << 1, 0.4, -0.3, 0.4, -0.5, 0.2, -0.3, 0.2, 0.7;
  h *= 1e-9;
  Mat3 hooke = 2 * m.mu * h;
  hooke.diagonal().array() += m.lambda * h.trace();
  EXPECT_LT((stress(m, h) - hooke).norm(), 1e-6 * hooke.norm());
}

// A bar pulled by 1e-6: force and narrowing give E and nu back.
TEST_P(MaterialContract, UniaxialTestGivesBackYoungsModulusAndPoissonsRatio) {
  for (const double poisson : {0.0, 0.3, 0.49}) {
    const TetMesh mesh = distorted(block_mesh(3, 2, 2, {0.3, 0.2, 0.2}), 0.01, 3);
    Boundary boundary;
    const double strain = 1e-6;
    std::vector<Eigen::Triplet<double>> motion;
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
      const Vec3 x = node_position(mesh, i);
      Mat3 axes = Mat3::Zero();
      int count = 0;
      if (x.x() < 1e-9 || x.x() > 0.3 - 1e-9) axes.col(count++) = Vec3::UnitX();
      if (x.x() > 0.3 - 1e-9) motion.emplace_back(3 * i, 0, 1.0);
      if (x.y() < 1e-9) axes.col(count++) = Vec3::UnitY();
      if (x.z() < 1e-9) axes.col(count++) = Vec3::UnitZ();
      if (count > 0) boundary.constraints.push_back({i, axes, count});
    }
    boundary.motions.resize(3 * mesh.nodes_m.rows(), 1);
    boundary.motions.setFromTriplets(motion.begin(), motion.end());
    const Statics statics(mesh, std::string(law().name()), boundary);
    const Moduli m = at(kYoung, poisson);
    const Equilibrium e = statics.solve(kYoung, poisson, VectorX(), VectorX::Constant(1, 0.3 * strain), nullptr, m.extra);
    ASSERT_TRUE(e.converged) << e.reason;
    EXPECT_NEAR(e.motion_reaction(0), kYoung * strain * 0.04, 1e-4 * kYoung * strain * 0.04);
    const Index corner = nearest_node(mesh, {0.3, 0.2, 0.2});
    EXPECT_NEAR(e.displacement_m(3 * corner + 1), -poisson * strain * 0.2, 1e-4 * strain * 0.2);
  }
}

// The same body with the corners of every tetrahedron in another (even) order.
TEST_P(MaterialContract, AnswerDoesNotDependOnTheOrderOfVertices) {
  const TetMesh mesh = distorted(block_mesh(3, 3, 3, {0.15, 0.15, 0.15}), 0.01, 5);
  TetMesh permuted = mesh;
  std::mt19937 random(1);
  static const int even[12][4] = {{0, 1, 2, 3}, {0, 2, 3, 1}, {0, 3, 1, 2}, {1, 0, 3, 2}, {1, 2, 0, 3}, {1, 3, 2, 0},
                                  {2, 0, 1, 3}, {2, 1, 3, 0}, {2, 3, 0, 1}, {3, 0, 2, 1}, {3, 1, 0, 2}, {3, 2, 1, 0}};
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
    const int* order = even[random() % 12];
    for (int a = 0; a < 4; ++a) permuted.tetrahedra(e, a) = mesh.tetrahedra(e, order[a]);
  }
  Boundary boundary;
  boundary.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
  boundary.forces = spread_over_patch(mesh, {0.075, 0.075, 0.15}, 0.04);
  const VectorX force = Vec3(1, 0.5, -6);
  const VectorX extra = at(kYoung, kPoisson).extra;
  const Equilibrium a =
      Statics(mesh, std::string(law().name()), boundary).solve(kYoung, kPoisson, force, VectorX(), nullptr, extra);
  const Equilibrium b =
      Statics(permuted, std::string(law().name()), boundary).solve(kYoung, kPoisson, force, VectorX(), nullptr, extra);
  ASSERT_TRUE(a.converged && b.converged) << a.reason << b.reason;
  EXPECT_GT(a.displacement_m.cwiseAbs().maxCoeff(), 2e-3);
  EXPECT_LT((a.displacement_m - b.displacement_m).cwiseAbs().maxCoeff(), 1e-9);
}

TEST_P(MaterialContract, RefusesModuliThatNoBodyHas) {
  EXPECT_THROW(moduli(-1, 0.3), Error);
  EXPECT_THROW(moduli(0, 0.3), Error);
  EXPECT_THROW(moduli(std::nan(""), 0.3), Error);
  EXPECT_THROW(moduli(1000, 0.5), Error);
  EXPECT_THROW(moduli(1000, -1), Error);
  EXPECT_THROW(material_law("no such law"), Error);
  EXPECT_EQ(&material_law(law().name()), &law());
}

INSTANTIATE_TEST_SUITE_P(Table, MaterialContract, testing::ValuesIn(material_table()),
                         [](const auto& each) { return std::string(each.param->name()); });

}  // namespace
}  // namespace palpate::fem::material_contract_test
