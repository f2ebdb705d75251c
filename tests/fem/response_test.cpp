// label: contract
// SPDX-License-Identifier: Apache-2.0
// What a Response answers, against full solves and central differences: along its branch, beside it, beyond it.
#include "palpate/fem/response.hpp"
#include "palpate/fem/response_nuisances.hpp"

#include <gtest/gtest.h>

#include "fem_meshes.hpp"
#include "palpate/core/error.hpp"

namespace palpate::fem::response_test {
namespace {

const double kYoung = 20e3;

class ResponseContract : public testing::TestWithParam<const char*> {
 protected:
  ResponseContract() : mesh(to_quadratic(block_mesh(2, 2, 2, {0.1, 0.1, 0.1}))) {
    contact = contact_columns(mesh, {0.05, 0.05, 0.1}, 0.03, -Vec3::UnitZ());
  }
  Response make(double load_n, int max_solves = 160) const {
    Boundary b;
    b.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
    b.forces = contact.forces;
    Response::Options options;
    options.poisson_lower = 0.1;
    options.poisson_upper = 0.45;
    options.branch_force_over_young = load_n / kYoung * -VectorX::Unit(6, 2);
    options.max_solves = max_solves;
    options.discretisation_error = 0.01;
    // Every boundary node, and the mean motion under the contact's columns.
    std::vector<Eigen::Triplet<double>> rows;
    int row = 0;
    for (Index i : nodes_where(mesh, [](const Vec3& x) { return x.z() > 0.04; }))
      for (int c = 0; c < 3; ++c) rows.emplace_back(row++, 3 * i + c, 1.0);
    for (int k = 0; k < 6; ++k)
      for (Eigen::SparseMatrix<double>::InnerIterator it(contact.forces, k); it; ++it)
        rows.emplace_back(row + k, static_cast<int>(it.row()), it.value());
    Eigen::SparseMatrix<double> watched(row + 6, 3 * mesh.nodes_m.rows());
    watched.setFromTriplets(rows.begin(), rows.end());
    return Response(mesh, GetParam(), b, watched, options);
  }
  TetMesh mesh;
  ContactColumns contact;
};

ResponseQuery query(double young_modulus_pa, double poisson_ratio, const VectorX& force) {
  return {young_modulus_pa, poisson_ratio, force, VectorX(0)};
}

VectorX load(double down_n, double aside_n = 0, double shift_nm = 0) {
  VectorX a = VectorX::Zero(6);
  a << aside_n, 0, -down_n, shift_nm, 0, 0;
  return a;
}

// Values and derivatives at places that are no points of the grid, for moduli over a factor of eight.
TEST_P(ResponseContract, AgreesWithFullSolves) {
  const Response response = make(6.0);
  const Response full = make(0.0);  // no branch: every answer is solved for
  const bool linear = std::string(GetParam()) == "linear";
  EXPECT_LE(response.branch_error(), 1e-3);
  EXPECT_DOUBLE_EQ(response.branch_end(), linear ? 0 : 1);
  for (double softer : {1.0, 0.3, 0.125})
    for (double nu : {0.11, 0.28, 0.43}) {
      const double young = kYoung / softer * 0.999;
      const VectorX a = load(5.9 * 0.999);
      const ResponseQuery q = query(young, nu, a);
      const ResponseState r = response.at(q);
      EXPECT_EQ(r.source, linear ? ResponseSource::superposed : ResponseSource::branch);
      ASSERT_TRUE(r.converged) << r.reason;
      const Certificate c = response.certify(r, q);
      ASSERT_TRUE(c.converged) << c.reason;
      EXPECT_LT(c.difference, 2e-3);
      EXPECT_LT(c.difference, r.error);
      EXPECT_EQ(response.inverted_elements(q), c.inverted_elements);
      EXPECT_TRUE(c.stable);
      EXPECT_FALSE(c.second_equilibrium);
      const ResponseState exact = full.solve(q);
      ASSERT_TRUE(exact.converged) << exact.reason;
      const auto near = [&](Index column, double tolerance) {
        EXPECT_LT((r.d_watched.col(column) - exact.d_watched.col(column)).norm(), tolerance * exact.d_watched.col(column).norm()) << column;
        EXPECT_LT((r.d_conjugate.col(column) - exact.d_conjugate.col(column)).norm(), tolerance * exact.d_conjugate.col(column).norm())
            << column;
      };
      near(0, 5e-3), near(1, 3e-2);
      for (Index k = 2; k < 8; ++k) near(k, 1e-2);
      EXPECT_LT((r.conjugate_m - exact.conjugate_m).norm(), 2e-3 * exact.conjugate_m.norm());
    }
}

// The answer's own derivatives are those of the answer (not of the body): a fit must descend on what it evaluates.
TEST_P(ResponseContract, DerivativesAreThoseOfTheAnswer) {
  const Response response = make(6.0);
  const VectorX a = load(4.0, 0.1, 0.01);
  const double nu = 0.31;
  const ResponseState r = response.at(query(kYoung, nu, a));
  const auto at = [&](double young, double poisson, const VectorX& force) { return response.at(query(young, poisson, force)).watched_m; };
  const auto check = [&](const VectorX& up, const VectorX& down, double step, const VectorX& exact, const char* what) {
    const VectorX d = (up - down) / (2 * step);
    EXPECT_LT((d - exact).norm(), 1e-5 * d.norm()) << what;
  };
  const double h = 1e-4;
  check(at(kYoung * std::exp(h), nu, a), at(kYoung * std::exp(-h), nu, a), h, r.d_watched.col(0), "log E");
  check(at(kYoung, nu + h, a), at(kYoung, nu - h, a), h, r.d_watched.col(1), "nu");
  for (Index k = 0; k < 6; ++k) {
    const VectorX step = 1e-3 * VectorX::Unit(6, k);
    check(at(kYoung, nu, a + step), at(kYoung, nu, a - step), 1e-3, r.d_force().col(k), "force");
  }
  // Along two directions at once: the same derivatives, added up.
  ResponseQuery along = query(kYoung, nu, a);
  along.along = LoadDirections{MatrixX::Random(6, 2), MatrixX(0, 2)};
  const ResponseState turned = response.at(along);
  EXPECT_LT((turned.d_watched.rightCols(2) - r.d_force() * along.along->force).norm(), 1e-9 * turned.d_watched.norm());
  EXPECT_EQ(turned.watched_m, r.watched_m);
}

// Beside the branch its error grows and says so; far beside and beyond the branch, answers are solved for.
TEST_P(ResponseContract, SaysWhereItsAnswersComeFrom) {
  if (std::string(GetParam()) == "linear") GTEST_SKIP() << "superposition has no branch to leave";
  const Response response = make(6.0);
  const ResponseState beside = response.at(query(kYoung, 0.3, load(5, 0.4)));
  EXPECT_EQ(beside.source, ResponseSource::branch);
  EXPECT_GT(beside.error, response.at(query(kYoung, 0.3, load(5))).error);
  EXPECT_LT(response.certify(beside, query(kYoung, 0.3, load(5, 0.4))).difference, beside.error);
  for (const VectorX& a : {load(5, 2), load(7), load(-1)}) {
    const ResponseState far = response.at(query(kYoung, 0.3, a));
    EXPECT_EQ(far.source, ResponseSource::solved);
    EXPECT_LT(response.certify(far, query(kYoung, 0.3, a)).difference, 1e-6);
  }
  EXPECT_EQ(response.at(query(kYoung, 0.47, load(5))).source, ResponseSource::solved);
}

INSTANTIATE_TEST_SUITE_P(Laws, ResponseContract, testing::Values("linear", "neo_hookean", "neo_hookean_stable", "foam"),
                         [](const auto& each) { return std::string(each.param); });

// A block on a rough table, a ball pressed into it by an imposed motion after a weight was put on: reactions and derivatives of the
// second step of a sequence against differences of the whole sequence.
class TouchedBlock : public testing::Test {
 protected:
  TouchedBlock() : mesh(to_quadratic(block_mesh(3, 3, 2, {0.1, 0.1, 0.06}))) {
    RigidContact table, ball;
    table.name = "table";
    table.shape = plane_shape();
    table.T_base_tool = tool_pose({0.05, 0.05, 0}, Vec3::UnitZ());
    table.law = Touch::friction;
    table.friction_coefficient = 0.5;
    table.seat_m = 1e-6;
    table.stiffness = 100;
    ball.name = "ball";
    ball.shape = sphere_shape(0.03);
    ball.T_base_tool = tool_pose({0.052, 0.047, 0.06}, -Vec3::UnitZ());
    options.contacts = {table, ball};
    options.driven = {{1, -Vec3::UnitZ()}};
    options.statics.residual_tolerance = 1e-12;
    options.friction_tolerance = 1e-11;
    boundary.forces = body_force(mesh);
  }
  Response make() const {
    Eigen::SparseMatrix<double> watched(3 * mesh.nodes_m.rows(), 3 * mesh.nodes_m.rows());
    watched.setIdentity();
    return Response(mesh, "neo_hookean", boundary, watched, options);
  }
  static ResponseQuery lying(double log_young, double nu) {
    return {std::exp(log_young), nu, Vec3(0, 0, -9.81 * 500), VectorX::Zero(1), true, LoadDirections{MatrixX::Zero(3, 1), MatrixX::Zero(1, 1)}};
  }
  /// The one direction of derivatives beside log E and nu: the ball's way.
  static ResponseQuery pressed(double log_young, double nu, double way_m) {
    ResponseQuery q = lying(log_young, nu);
    q.motion(0) = way_m;
    q.along->motion(0, 0) = 1;
    return q;
  }
  TetMesh mesh;
  Boundary boundary;
  Response::Options options;
};

TEST_F(TouchedBlock, SequencesHaveTheirDerivatives) {
  const Response response = make();
  EXPECT_TRUE(response.touches());
  EXPECT_EQ(response.motion_count(), 1);
  const auto at = [&](double log_young, double nu, double way_m) {
    const ResponseState first = response.solve(lying(log_young, nu));
    EXPECT_TRUE(first.converged) << first.reason;
    ResponseStart start;
    start.from = first.solution;
    start.on_path = true;
    return response.solve(pressed(log_young, nu, way_m), start);
  };
  const Vec3 here(std::log(kYoung), 0.3, 0.004);
  const ResponseState state = at(here(0), here(1), here(2));
  ASSERT_TRUE(state.converged) << state.reason;
  EXPECT_EQ(state.source, ResponseSource::solved);
  EXPECT_GT(state.reaction_n(0), 0.1) << "the ball pushes along its way";
  ASSERT_EQ(state.d_watched.cols(), 3);
  const Vec3 steps(1e-5, 1e-5, 1e-8);  // short of the next point of the skin that the ball meets
  for (Index k = 0; k < 3; ++k) {
    Vec3 up = here, down = here;
    up(k) += steps(k), down(k) -= steps(k);
    const ResponseState a = at(up(0), up(1), up(2)), b = at(down(0), down(1), down(2));
    const VectorX du = (a.watched_m - b.watched_m) / (2 * steps(k)), dr = (a.reaction_n - b.reaction_n) / (2 * steps(k));
    EXPECT_LT((state.d_watched.col(k) - du).norm(), 2e-3 * du.norm() + 1e-9) << k;
    EXPECT_NEAR(state.d_reaction(0, k), dr(0), 2e-3 * std::abs(dr(0)) + 1e-6) << k;
  }
}

TEST_F(TouchedBlock, WhatDoesNotFitIsRefused) {
  const Response response = make();
  const ResponseState state = response.solve(lying(std::log(kYoung), 0.3));
  ASSERT_TRUE(state.converged) << state.reason;
  EXPECT_THROW(response.certify(state, lying(std::log(kYoung), 0.3)), Error);
  EXPECT_THROW(response.readings(lying(std::log(kYoung), 0.3)), Error);
  ResponseQuery plain = lying(std::log(kYoung), 0.3);
  plain.derivatives = false;
  ResponseStart start;
  start.from = response.solve(plain).solution;
  start.on_path = true;
  EXPECT_THROW(response.solve(pressed(std::log(kYoung), 0.3, 0.004), start), Error) << "the step before has no derivatives to carry on";
  plain.motion.resize(0);
  EXPECT_THROW(response.solve(plain), Error);
}

// A co-rotational body gives way under a high pressure: the branch ends before, and the pressure tells why.
TEST(Branch, EndsWhereTheMaterialGivesWay) {
  const TetMesh mesh = to_quadratic(block_mesh(3, 3, 3, {0.1, 0.1, 0.1}));
  Boundary b;
  b.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
  b.forces = spread_over_patch(mesh, {0.05, 0.05, 0.1}, 0.02);
  Response::Options options;
  options.poisson_upper = 0.4;
  options.statics.max_load_steps = 12;
  options.branch_force_over_young = Vec3(0, 0, -60 / kYoung);
  Eigen::SparseMatrix<double> watched = b.forces.transpose();
  const Response response(mesh, "stvk", b, watched, options);
  EXPECT_LT(response.branch_end(), 1);
}

TEST(Pressure, IsReportedOverYoung) {
  const TetMesh mesh = to_quadratic(block_mesh(10, 10, 2, {0.1, 0.1, 0.04}));
  Boundary b;
  b.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
  b.forces = spread_over_patch(mesh, {0.05, 0.05, 0.04}, 0.025);
  const Statics statics(mesh, "linear", b);
  const double pressure_pa = 3 / (EIGEN_PI * 0.025 * 0.025);
  const Equilibrium e = statics.solve(kYoung, 0.3, Vec3(0, 0, -3), VectorX(0));
  // Nodes at the rim carry part of their share only, hence a little less.
  EXPECT_NEAR(e.pressure_over_young, pressure_pa / kYoung, 0.15 * pressure_pa / kYoung);
  EXPECT_NEAR(statics.solve(kYoung, 0.3, Vec3(0, 0, -6), VectorX(0)).pressure_over_young, 2 * e.pressure_over_young, 1e-12);
}

// Moments of the contact's columns: a shift moves the force's centre metre by metre, a wider patch spreads it.
TEST(ContactColumns, ShiftAndWiden) {
  const TetMesh mesh = to_quadratic(block_mesh(8, 8, 2, {0.16, 0.16, 0.04}));
  const Vec3 centre(0.085, 0.075, 0.04);
  const double radius = 0.03;
  const ContactColumns c = contact_columns(mesh, centre, radius, -Vec3::UnitZ());
  const auto moment = [&](Index column, auto&& weight) {
    double sum = 0;
    for (Eigen::SparseMatrix<double>::InnerIterator it(c.forces, column); it; ++it)
      if (it.row() % 3 == 2) sum -= it.value() * weight(node_position(mesh, static_cast<Index>(it.row()) / 3) - centre);
    return sum;
  };
  for (Index k : {3, 4, 5}) EXPECT_NEAR(moment(k, [](const Vec3&) { return 1.0; }), 0, 1e-9);
  EXPECT_NEAR(moment(3, [&](const Vec3& x) { return x.dot(c.tangent_1); }), 1, 0.03);
  EXPECT_NEAR(moment(3, [&](const Vec3& x) { return x.dot(c.tangent_2); }), 0, 0.03);
  EXPECT_NEAR(moment(4, [&](const Vec3& x) { return x.dot(c.tangent_2); }), 1, 0.03);
  // The mean squared distance in a disc is r^2 / 2; its derivative to log r is r^2.
  EXPECT_NEAR(moment(5, [](const Vec3& x) { return x.head<2>().squaredNorm(); }), radius * radius, 0.05 * radius * radius);
}

}  // namespace
}  // namespace palpate::fem::response_test
