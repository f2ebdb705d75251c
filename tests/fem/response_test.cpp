// label: contract
// SPDX-License-Identifier: Apache-2.0
// What a Response answers, against full solves and central differences: along its branch, beside it, beyond it.
#include "palpate/fem/response.hpp"

#include <gtest/gtest.h>

#include "fem_meshes.hpp"

namespace palpate::fem {
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
  const VectorX none = VectorX(0);
};

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
      const ResponseState r = response.at(young, nu, a, none);
      EXPECT_EQ(r.source, linear ? ResponseSource::superposed : ResponseSource::branch);
      ASSERT_TRUE(r.converged) << r.reason;
      const Equilibrium e = full.statics().solve(young, nu, a, none);
      ASSERT_TRUE(e.converged) << e.reason;
      const Certificate c = response.certify(r, young, nu, a, none);
      ASSERT_TRUE(c.converged) << c.reason;
      EXPECT_LT(c.difference, 2e-3);
      EXPECT_LT(c.difference, r.error);
      EXPECT_TRUE(c.stable);
      EXPECT_FALSE(c.second_equilibrium);
      const ResponseState exact = full.at(young, nu, a, none);
      EXPECT_LT((r.d_log_young - exact.d_log_young).norm(), 5e-3 * exact.d_log_young.norm());
      EXPECT_LT((r.d_poisson - exact.d_poisson).norm(), 2e-2 * exact.d_poisson.norm());
      for (Index k = 0; k < 6; ++k)
        EXPECT_LT((r.d_force.col(k) - exact.d_force.col(k)).norm(), 1e-2 * exact.d_force.col(k).norm()) << k;
    }
}

// The answer's own derivatives are those of the answer (not of the body): a fit must descend on what it evaluates.
TEST_P(ResponseContract, DerivativesAreThoseOfTheAnswer) {
  const Response response = make(6.0);
  const VectorX a = load(4.0, 0.1, 0.01);
  const double nu = 0.31;
  const ResponseState r = response.at(kYoung, nu, a, none);
  const auto check = [&](const VectorX& up, const VectorX& down, double step, const VectorX& exact, const char* what) {
    const VectorX d = (up - down) / (2 * step);
    EXPECT_LT((d - exact).norm(), 1e-5 * d.norm()) << what;
  };
  const double h = 1e-4;
  check(response.at(kYoung * std::exp(h), nu, a, none).watched_m, response.at(kYoung * std::exp(-h), nu, a, none).watched_m,
        h, r.d_log_young, "log E");
  check(response.at(kYoung, nu + h, a, none).watched_m, response.at(kYoung, nu - h, a, none).watched_m, h, r.d_poisson,
        "nu");
  for (Index k = 0; k < 6; ++k) {
    const VectorX step = 1e-3 * VectorX::Unit(6, k);
    check(response.at(kYoung, nu, a + step, none).watched_m, response.at(kYoung, nu, a - step, none).watched_m, 1e-3,
          r.d_force.col(k), "force");
  }
}

// Beside the branch its error grows and says so; far beside and beyond the branch, answers are solved for.
TEST_P(ResponseContract, SaysWhereItsAnswersComeFrom) {
  if (std::string(GetParam()) == "linear") GTEST_SKIP() << "superposition has no branch to leave";
  const Response response = make(6.0);
  const ResponseState beside = response.at(kYoung, 0.3, load(5, 0.4), none);
  EXPECT_EQ(beside.source, ResponseSource::branch);
  EXPECT_GT(beside.error, response.at(kYoung, 0.3, load(5), none).error);
  EXPECT_LT(response.certify(beside, kYoung, 0.3, load(5, 0.4), none).difference, beside.error);
  for (const VectorX& a : {load(5, 2), load(7), load(-1)}) {
    const ResponseState far = response.at(kYoung, 0.3, a, none);
    EXPECT_EQ(far.source, ResponseSource::solved);
    EXPECT_LT(response.certify(far, kYoung, 0.3, a, none).difference, 1e-6);
  }
  EXPECT_EQ(response.at(kYoung, 0.47, load(5), none).source, ResponseSource::solved);
}

INSTANTIATE_TEST_SUITE_P(Laws, ResponseContract, testing::Values("linear", "neo_hookean", "neo_hookean_stable", "foam"),
                         [](const auto& each) { return std::string(each.param); });

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
}  // namespace palpate::fem
