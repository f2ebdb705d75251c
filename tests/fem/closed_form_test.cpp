// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The solver against closed forms and reference values that it had no part in.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "fem_meshes.hpp"
#include "palpate/fem/assembly.hpp"
#include "palpate/fem/reduced_system.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem::closed_form_test {
namespace {

constexpr double kYoung = 20000;

TetMesh with_nodes(const TetMesh& linear, int nodes) { return nodes == 4 ? linear : to_quadratic(linear); }

StaticsOptions options(Dilatation dilatation) {
  StaticsOptions o;
  o.dilatation = dilatation;
  return o;
}

// Consistent nodal shares of a uniform traction on the boundary faces whose nodes all satisfy a predicate; sums to one.
template <typename Predicate>
Eigen::SparseMatrix<double> traction(const TetMesh& mesh, Predicate&& on_face) {
  const Tetrahedra faces = boundary_faces(mesh);
  VectorX share = VectorX::Zero(mesh.nodes_m.rows());
  for (Index f = 0; f < faces.rows(); ++f) {
    bool all = true;
    for (int k = 0; k < faces.cols(); ++k) all = all && on_face(node_position(mesh, faces(f, k)));
    if (!all) continue;
    const Vec3 a = node_position(mesh, faces(f, 0)), b = node_position(mesh, faces(f, 1)),
               c = node_position(mesh, faces(f, 2));
    const double area = 0.5 * (b - a).cross(c - a).norm();
    // Flat faces: the corners' quadratic shape functions integrate to zero, the midpoints' to a third of the area each.
    for (int k = 0; k < 3; ++k) share(faces(f, faces.cols() == 3 ? k : 3 + k)) += area / 3;
  }
  share /= share.sum();
  std::vector<Eigen::Triplet<double>> triplets;
  for (Index i = 0; i < share.size(); ++i)
    for (int k = 0; k < 3; ++k)
      if (share(i) != 0) triplets.emplace_back(3 * i + k, k, share(i));
  Eigen::SparseMatrix<double> columns(3 * mesh.nodes_m.rows(), 3);
  columns.setFromTriplets(triplets.begin(), triplets.end());
  return columns;
}

struct Element {
  int nodes;
  Dilatation dilatation;
};
class EveryElement : public testing::TestWithParam<Element> {};
INSTANTIATE_TEST_SUITE_P(Elements, EveryElement,
                         testing::Values(Element{4, Dilatation::pointwise}, Element{4, Dilatation::averaged},
                                         Element{10, Dilatation::pointwise}, Element{10, Dilatation::averaged}),
                         [](const auto& each) {
                           return "tet" + std::to_string(each.param.nodes) +
                                  (each.param.dilatation == Dilatation::averaged ? "_averaged" : "");
                         });

TEST_P(EveryElement, PatchTest) {
  const TetMesh mesh = with_nodes(distorted(block_mesh(3, 3, 3, {0.1, 0.1, 0.1}), 0.008, 2), GetParam().nodes);
  Mat3 gradient;
  gradient << 0.2, 0.15, -0.1, 0.05, -0.15, 0.1, -0.2, 0.1, 0.1;
  Boundary b;
  std::vector<Eigen::Triplet<double>> motion;
  const Tetrahedra faces = boundary_faces(mesh);
  std::vector<char> outer(mesh.nodes_m.rows(), 0);
  for (Index k = 0; k < faces.size(); ++k) outer[faces.data()[k]] = 1;
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    if (!outer[i]) continue;
    b.constraints.push_back({i, Mat3::Identity(), 3});
    const Vec3 u = gradient * node_position(mesh, i);
    for (int k = 0; k < 3; ++k) motion.emplace_back(3 * i + k, 0, u(k));
  }
  b.motions.resize(3 * mesh.nodes_m.rows(), 1);
  b.motions.setFromTriplets(motion.begin(), motion.end());
  for (const char* law : {"linear", "neo_hookean", "corotational"}) {
    StaticsOptions o = options(GetParam().dilatation);
    o.residual_tolerance = 1e-13;
    const Equilibrium e = Statics(mesh, law, b, o).solve(kYoung, 0.45, VectorX(), VectorX::Ones(1));
    ASSERT_TRUE(e.converged) << law << ": " << e.reason;
    double worst = 0;
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i)
      worst = std::max(worst, (e.displacement_m.segment<3>(3 * i) - gradient * node_position(mesh, i)).norm());
    EXPECT_LT(worst, 1e-12 * 0.1 * 10) << law;
  }
}

TEST_P(EveryElement, SixRigidModesAndNoMore) {
  const TetMesh mesh = with_nodes(distorted(block_mesh(2, 2, 2, {0.1, 0.1, 0.1}), 0.01, 2), GetParam().nodes);
  const Assembly assembly(mesh, GetParam().dilatation);
  BlockValues blocks;
  const Index n = 3 * static_cast<Index>(mesh.nodes_m.rows());
  assembly.tangent(material_law("neo_hookean"), moduli(kYoung, 0.4), VectorX::Zero(n), blocks);
  Eigen::MatrixXd k(n, n);
  for (Index c = 0; c < n; ++c) k.col(c) = assembly.multiply(blocks, VectorX::Unit(n, c));
  const MatrixX modes = rigid_motions(mesh.nodes_m);
  EXPECT_LT((k * modes).cwiseAbs().maxCoeff(), 1e-12 * k.cwiseAbs().maxCoeff());
  const VectorX values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(k, Eigen::EigenvaluesOnly).eigenvalues();
  EXPECT_LT(values.head(6).cwiseAbs().maxCoeff(), 1e-12 * values(n - 1));
  EXPECT_GT(values(6), 1e-5 * values(n - 1));
}

// Symmetry planes at x = y = z = 0, the face x = size driven; `lateral` also holds the two other faces.
Boundary driven_bar(const TetMesh& mesh, const Vec3& size, bool lateral) {
  Boundary b;
  std::vector<Eigen::Triplet<double>> motion;
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    const Vec3 x = node_position(mesh, i);
    Mat3 axes = Mat3::Zero();
    int count = 0;
    for (int k = 0; k < 3; ++k)
      if (x(k) < 1e-9 || (x(k) > size(k) - 1e-9 && (k == 0 || lateral))) axes.col(count++) = Vec3::Unit(k);
    if (x.x() > size.x() - 1e-9) motion.emplace_back(3 * i, 0, 1.0);
    if (count > 0) b.constraints.push_back({i, axes, count});
  }
  b.motions.resize(3 * mesh.nodes_m.rows(), 1);
  b.motions.setFromTriplets(motion.begin(), motion.end());
  return b;
}

TEST_P(EveryElement, ConfinedBarHasTheOedometricModulus) {
  const Vec3 size(0.2, 0.1, 0.1);
  const TetMesh mesh = with_nodes(distorted(block_mesh(4, 2, 2, size), 0.01, 4), GetParam().nodes);
  const Statics s(mesh, "linear", driven_bar(mesh, size, true), options(GetParam().dilatation));
  for (double nu : {0.0, 0.3, 0.49}) {
    const Equilibrium e = s.solve(kYoung, nu, VectorX(), VectorX::Constant(1, -0.002));
    const double modulus = kYoung * (1 - nu) / ((1 + nu) * (1 - 2 * nu));
    EXPECT_NEAR(e.motion_reaction(0), -modulus * 0.01 * 0.01, 1e-9 * modulus);
  }
}

TEST_P(EveryElement, LargeUniaxialStretchOfNeoHooke) {
  const Vec3 size(0.2, 0.1, 0.1);
  const TetMesh mesh = with_nodes(distorted(block_mesh(4, 2, 2, size), 0.01, 4), GetParam().nodes);
  const Statics s(mesh, "neo_hookean", driven_bar(mesh, size, false), options(GetParam().dilatation));
  const double nu = 0.4;
  const Moduli m = moduli(kYoung, nu);
  for (double stretch : {0.5, 1.8}) {
    // mu (b - 1/b) + lambda ln(a b^2) / b = 0 for the lateral stretch b
    double b = std::pow(stretch, -nu);
    for (int i = 0; i < 50; ++i) {
      const double f = m.mu * (b * b - 1) + m.lambda * std::log(stretch * b * b);
      b -= f / (2 * m.mu * b + 2 * m.lambda / b);
    }
    const double stress = m.mu * (stretch - 1 / stretch) + m.lambda * std::log(stretch * b * b) / stretch;
    const Equilibrium e = s.solve(kYoung, nu, VectorX(), VectorX::Constant(1, 0.2 * (stretch - 1)));
    ASSERT_TRUE(e.converged) << e.reason;
    EXPECT_NEAR(e.motion_reaction(0), stress * 0.01, 1e-8 * kYoung * 0.01);
    const Index corner = nearest_node(mesh, size);
    EXPECT_NEAR(e.displacement_m(3 * corner + 1), 0.1 * (b - 1), 1e-8);
  }
}

// A bar accelerated by a pull at one end: the force falls linearly to the free end, u(L) - u(0) = F L / (2 E A) for nu = 0.
TEST(FreeBody, AcceleratedBarStretchesByHalf) {
  const TetMesh mesh = to_quadratic(distorted(block_mesh(5, 2, 2, {0.5, 0.1, 0.1}), 0.01, 6));
  Boundary b;
  b.inertia_relief = true;
  b.forces = traction(mesh, [](const Vec3& x) { return x.x() > 0.5 - 1e-9; });
  const Equilibrium e = Statics(mesh, "linear", b).solve(kYoung, 0, Vec3(3, 0, 0), VectorX());
  const Index tip = nearest_node(mesh, {0.5, 0.05, 0.05}), tail = nearest_node(mesh, {0, 0.05, 0.05});
  EXPECT_NEAR(e.displacement_m(3 * tip) - e.displacement_m(3 * tail), 3 * 0.5 / (2 * kYoung * 0.01), 1e-9);
}

// Tip deflection over Timoshenko's, 1 x 0.1 x 0.1 m under end shear.
double cantilever(const TetMesh& mesh, double nu, Dilatation dilatation) {
  Boundary b;
  b.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; }));
  b.forces = traction(mesh, [](const Vec3& x) { return x.x() > 1 - 1e-9; });
  const Equilibrium e = Statics(mesh, "linear", b, options(dilatation)).solve(1e6, nu, Vec3(0, 0, -1), VectorX());
  const double inertia = 1e-4 / 12, shear = 1e6 / (2 * (1 + nu)), k = 10 * (1 + nu) / (12 + 11 * nu);
  const Index tip = nearest_node(mesh, {1, 0.05, 0.05});
  return -e.displacement_m(3 * tip + 2) / (1 / (3 * 1e6 * inertia) + 1 / (k * shear * 0.01));
}

// References: another code's quadratic elements, 20 x 2 x 2 and (nearly converged) 40 x 4 x 4 cells.
TEST(Cantilever, QuadraticElementsMeetTheReferenceAndAveragingCuresLocking) {
  const TetMesh mesh = to_quadratic(block_mesh(20, 2, 2, {1, 0.1, 0.1}));
  EXPECT_NEAR(cantilever(mesh, 0.3, Dilatation::pointwise), 0.989, 0.002);
  EXPECT_NEAR(cantilever(mesh, 0.49, Dilatation::pointwise), 0.956, 0.006);
  const double averaged = cantilever(mesh, 0.49, Dilatation::averaged);
  EXPECT_NEAR(averaged, 0.973, 0.006);
  EXPECT_NEAR(cantilever(mesh, 0.4999, Dilatation::averaged), averaged, 0.003);
  EXPECT_LT(cantilever(mesh, 0.4999, Dilatation::pointwise), averaged - 0.015);
}

// Cube of 0.15 m, bottom held, uniform pressure on a disc at the top. References: CalculiX 2.20, C3D4 and C3D10 (linear and
// NLGEOM Neo-Hooke), and Vega FEM's exact co-rotational model, on the same meshes.
double pressed_cube(int cells, int nodes, const char* law, double nu, double radius, double force, Dilatation d) {
  const TetMesh mesh = with_nodes(block_mesh(cells, cells, cells, {0.15, 0.15, 0.15}, 1), nodes);
  Boundary b;
  b.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
  b.forces = spread_over_patch(mesh, {0.075, 0.075, 0.15}, radius);
  const Equilibrium e = Statics(mesh, law, b, options(d)).solve(kYoung, nu, Vec3(0, 0, -force), VectorX());
  EXPECT_TRUE(e.converged) << e.reason;
  return -(b.forces.col(2).transpose() * e.displacement_m).value();
}

TEST(PressedCubeElsewhere, MeetsOtherProgramsOnTheSameMesh) {
  const auto pointwise = Dilatation::pointwise;
  EXPECT_NEAR(pressed_cube(6, 4, "linear", 0.3, 0.025, 30, pointwise), 2.122605e-2, 5e-4 * 2.1e-2);
  EXPECT_NEAR(pressed_cube(6, 4, "corotational", 0.3, 0.025, 10, pointwise), 7.371653e-3, 5e-4 * 7.4e-3);
  EXPECT_NEAR(pressed_cube(6, 4, "neo_hookean_isochoric", 0.3, 0.025, 10, pointwise), 6.958566e-3, 5e-4 * 7e-3);
  EXPECT_NEAR(pressed_cube(6, 10, "neo_hookean_isochoric", 0.3, 0.025, 10, pointwise), 9.604307e-3, 5e-4 * 9.6e-3);
  EXPECT_NEAR(pressed_cube(6, 10, "linear", 0.3, 0.025, 30, pointwise), 2.7537e-2, 1e-3 * 2.75e-2);
}

// Large rotations: elastica (boundary value problem of the inextensible beam), P L^2 / (E I) = 1, 2, 5.
TEST(Elastica, LargeRotationOfASlenderBeam) {
  const double height = 0.04, inertia = std::pow(height, 4) / 12, young = 1e6;
  const TetMesh mesh = to_quadratic(block_mesh(24, 1, 1, {1, height, height}));
  Boundary b;
  b.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; }));
  b.forces = traction(mesh, [](const Vec3& x) { return x.x() > 1 - 1e-9; });
  const Statics s(mesh, "neo_hookean", b, options(Dilatation::averaged));
  const Index tip = nearest_node(mesh, {1, height / 2, height / 2});
  const double expected[3][3] = {{1, 0.30172, 0.05643}, {2, 0.49346, 0.16064}, {5, 0.71379, 0.38763}};
  VectorX start;
  for (const auto& [load, drop, shortening] : expected) {
    const Equilibrium e =
        s.solve(young, 0.3, Vec3(0, 0, -load * young * inertia), VectorX(), start.size() ? &start : nullptr);
    ASSERT_TRUE(e.converged) << e.reason;
    start = e.displacement_m;
    EXPECT_NEAR(-e.displacement_m(3 * tip + 2), drop, 0.015 * drop);
    EXPECT_NEAR(-e.displacement_m(3 * tip), shortening, 0.025 * shortening);
  }
}

// A cube pressed to 60 % between bonded plates, from rest in one call.
TEST(Robustness, CubePressedToFortyPercentOfItsHeight) {
  const TetMesh mesh = to_quadratic(block_mesh(3, 3, 3, {0.1, 0.1, 0.1}));
  Boundary b;
  std::vector<Eigen::Triplet<double>> motion;
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    const double z = node_position(mesh, i).z();
    if (z > 1e-9 && z < 0.1 - 1e-9) continue;
    b.constraints.push_back({i, Mat3::Identity(), 3});
    if (z > 0.05) motion.emplace_back(3 * i + 2, 0, -1.0);
  }
  b.motions.resize(3 * mesh.nodes_m.rows(), 1);
  b.motions.setFromTriplets(motion.begin(), motion.end());
  const auto press = [&](const char* law, double nu, Dilatation dilatation) {
    const Equilibrium e =
        Statics(mesh, law, b, options(dilatation)).solve(kYoung, nu, VectorX(), VectorX::Constant(1, 0.06));
    EXPECT_TRUE(e.converged) << law << ": " << e.reason;
    EXPECT_EQ(e.inverted_elements, 0) << law;
    EXPECT_GT(e.motion_reaction(0), 0.6 * kYoung * 0.01) << law;  // at least as stiff as the small-strain bar
    EXPECT_LT(e.newton_steps, 40) << law;
  };
  for (double nu : {0.3, 0.45}) {
    press("neo_hookean", nu, Dilatation::pointwise);
    press("neo_hookean", nu, Dilatation::averaged);
    press("neo_hookean_isochoric", nu, Dilatation::averaged);
    press("foam", nu, Dilatation::pointwise);
  }
}

}  // namespace
}  // namespace palpate::fem::closed_form_test
