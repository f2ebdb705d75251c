// label: contract
// SPDX-License-Identifier: Apache-2.0
// The reduced model of a linear material against full solves and their exact sensitivities, over the whole range of nu.
#include "palpate/fem/linear_response.hpp"

#include <gtest/gtest.h>

#include "fem_meshes.hpp"

namespace palpate::fem::linear_response_test {
namespace {

struct Case {
  int nodes;
  Dilatation dilatation;
  double poisson_lower, poisson_upper;
};

class LinearResponseContract : public testing::TestWithParam<Case> {
 protected:
  LinearResponseContract() : mesh(distorted(block_mesh(2, 2, 3, {0.1, 0.1, 0.15}), 0.008, 11)) {
    if (GetParam().nodes == 10) mesh = to_quadratic(mesh);
    options.dilatation = GetParam().dilatation;
    range.poisson_lower = GetParam().poisson_lower;
    range.poisson_upper = GetParam().poisson_upper;
  }
  // Two loads, a sliding bottom, a top that is driven down and sideways.
  Boundary driven() const {
    Boundary b;
    Mat3 slide = Mat3::Zero();
    slide.col(0) = Vec3(0.2, -0.1, 1).normalized();
    std::vector<Eigen::Triplet<double>> motion;
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
      const Vec3 x = node_position(mesh, i);
      if (x.z() < 1e-9) b.constraints.push_back({i, slide, 1});
      if (x.z() > 0.15 - 1e-9) {
        b.constraints.push_back({i, Mat3::Identity(), 3});
        motion.emplace_back(3 * i + 2, 0, 1.0);
        motion.emplace_back(3 * i, 1, 1.0);
      }
    }
    b.motions.resize(3 * mesh.nodes_m.rows(), 2);
    b.motions.setFromTriplets(motion.begin(), motion.end());
    b.forces = hstack({spread_over_patch(mesh, {0, 0.05, 0.07}, 0.03), body_force(mesh)});
    return b;
  }
  Boundary free_body() const {
    Boundary b;
    b.inertia_relief = true;
    b.forces = hstack({spread_over_patch(mesh, {0.05, 0.05, 0.15}, 0.03), spread_over_patch(mesh, {0.05, 0.05, 0}, 0.03)});
    return b;
  }
  Eigen::SparseMatrix<double> everything() const {
    Eigen::SparseMatrix<double> rows(3 * mesh.nodes_m.rows(), 3 * mesh.nodes_m.rows());
    rows.setIdentity();
    return rows;
  }
  // Near nu = 0.5 a step of nu is a huge one of the polynomial's variable z, with dnu/dz = (1 - 2 nu) / 2: a derivative to
  // nu cannot have more digits than that leaves. And the slope of a polynomial of degree n that errs by 1e-7 may err by n^2 times
  // that at its ends (Markov).
  static double slope_tolerance(double nu, double slope, double value) { return 2e-5 * slope + 5e-6 * value / (1 - 2 * nu); }
  void compare(const Boundary& boundary, const VectorX& a, const VectorX& b) const {
    const Statics statics(mesh, "linear", boundary, options);
    const LinearResponse response(statics, everything(), range);
    const double young = 20000;
    for (double share : {0.0, 0.11, 0.5, 0.83, 1.0}) {
      const double nu = range.poisson_lower + share * (range.poisson_upper - range.poisson_lower);
      const auto unit = response.at(nu);
      const Equilibrium full = statics.solve(young, nu, a, b);
      const Sensitivity exact = statics.sensitivity(full);
      const VectorX u = unit->force * (a / young) + unit->motion * b;
      EXPECT_LT((u - full.displacement_m).norm(), 1e-6 * u.norm()) << nu;
      const VectorX d_nu = unit->force_d_poisson * (a / young) + unit->motion_d_poisson * b;
      EXPECT_LT((d_nu - exact.d_poisson).norm(), slope_tolerance(nu, d_nu.norm(), u.norm())) << nu;
      EXPECT_LT((unit->force / young - exact.d_force).norm(), 1e-6 * exact.d_force.norm()) << nu;
      if (b.size() == 0) continue;
      const VectorX reaction = unit->reaction_force * a + young * (unit->reaction_motion * b);
      EXPECT_LT((reaction - full.motion_reaction).norm(), 1e-6 * reaction.norm()) << nu;
      const VectorX reaction_d_nu = unit->reaction_force_d_poisson * a + young * (unit->reaction_motion_d_poisson * b);
      EXPECT_LT((reaction_d_nu - exact.reaction_d_poisson).norm(),
                slope_tolerance(nu, reaction_d_nu.norm(), reaction.norm()))
          << nu;
    }
    EXPECT_LT(response.interpolation_error(), range.tolerance);
    EXPECT_GT(response.interpolation_error(), 0);
  }
  TetMesh mesh;
  StaticsOptions options;
  LinearResponse::Options range;
};

TEST_P(LinearResponseContract, DrivenBody) {
  compare(driven(), (VectorX(6) << 2, 1, 0, 0, 1000, -9000).finished(), Eigen::Vector2d(-0.02, 0.01));
}

TEST_P(LinearResponseContract, FreeBody) {
  compare(free_body(), (VectorX(6) << 0.3, -0.2, -8, 0.1, 0, 7.5).finished(), VectorX(0));
}

// Where the polynomial cannot be had, answers are solved for: same numbers, one factorisation each.
TEST_P(LinearResponseContract, SolvesOutsideItsRange) {
  const Statics statics(mesh, "linear", free_body(), options);
  LinearResponse::Options narrow = range;
  narrow.poisson_lower = narrow.poisson_upper = 0.2;
  const LinearResponse response(statics, everything(), narrow);
  for (double nu : {0.2, 0.1, 0.2, 0.4}) {
    const auto unit = response.at(nu);
    const Equilibrium full = statics.solve(1, nu, VectorX::Unit(6, 2), VectorX(0));
    EXPECT_LT((unit->force.col(2) - full.displacement_m).norm(), 1e-9 * full.displacement_m.norm());
  }
  EXPECT_EQ(response.factorisations(), 3);
  EXPECT_EQ(response.interpolation_error(), 0);
}

// The first rows of all answers as sums of few fields, and the others alone.
TEST_P(LinearResponseContract, SpansItsAnswers) {
  const Statics statics(mesh, "linear", driven(), options);
  const LinearResponse response(statics, everything(), range);
  const Index all = 3 * static_cast<Index>(mesh.nodes_m.rows()), rows = all - 30;
  const double middle = 0.5 * (range.poisson_lower + range.poisson_upper);
  EXPECT_EQ(response.span(rows, middle), nullptr) << "nothing was solved for yet";
  response.at(middle);
  EXPECT_EQ(response.span(rows, range.poisson_upper + 1e-3), nullptr);
  for (double share : {0.0, 0.3, 0.9}) {
    const double nu = range.poisson_lower + share * (range.poisson_upper - range.poisson_lower);
    const auto unit = response.at(nu);
    const auto span = response.span(rows, nu);
    ASSERT_NE(span, nullptr);
    const ResponseSpan::Terms terms = span->terms_at(nu);
    EXPECT_LT(span->fields.cols(), 8 * terms.value.size()) << "no fewer than the polynomial has terms";
    for (Index load = 0; load < 8; ++load) {
      const auto fields = span->fields.middleCols(span->first[static_cast<std::size_t>(load)], span->count_of(load));
      const MatrixX& shares = span->share[static_cast<std::size_t>(load)];
      const bool pushes = load < 6;
      const VectorX value = (pushes ? unit->force.col(load) : unit->motion.col(load - 6)).head(rows);
      const VectorX slope = (pushes ? unit->force_d_poisson.col(load) : unit->motion_d_poisson.col(load - 6)).head(rows);
      EXPECT_LT((fields * (shares * terms.value) - value).norm(), 1e-6 * value.norm()) << load;
      EXPECT_LT((fields * (shares * terms.d_poisson) - slope).norm(), 2 * slope_tolerance(nu, slope.norm(), value.norm())) << load;
    }
    const UnitResponses last = response.rows_from(rows, nu);
    EXPECT_EQ(last.force, unit->force.bottomRows(30));
    EXPECT_EQ(last.motion_d_poisson, unit->motion_d_poisson.bottomRows(30));
    EXPECT_EQ(last.reaction_motion, unit->reaction_motion);
    EXPECT_EQ(last.largest_gradient_force, unit->largest_gradient_force);
  }
}

// The whole displacement and what it turns inside out, at loads where some of it is; with the same watched rows as without.
TEST_P(LinearResponseContract, KnowsTheWholeDisplacement) {
  const Statics statics(mesh, "linear", driven(), options);
  const Eigen::SparseMatrix<double> some = everything().topRows(12);
  const LinearResponse without(statics, some, range);
  LinearResponse::Options whole = range;
  whole.field_limit_bytes = 1e9;
  const LinearResponse response(statics, some, whole);
  const VectorX a = (VectorX(6) << 20, 10, 0, 0, 1000, -9000).finished();
  const Eigen::Vector2d b(-0.1, 0.05);
  EXPECT_FALSE(response.displacement_m(0.5 * (range.poisson_lower + range.poisson_upper), a, b)) << "nothing was solved for yet";
  int most = 0;
  for (double share : {0.0, 0.11, 0.83, 1.0}) {
    const double nu = range.poisson_lower + share * (range.poisson_upper - range.poisson_lower), young = 20000;
    const auto unit = response.at(nu), plain = without.at(nu);
    EXPECT_EQ(unit->force, plain->force);
    EXPECT_EQ(unit->motion_d_poisson, plain->motion_d_poisson);
    const auto field_m = response.displacement_m(nu, a / young, b);
    ASSERT_TRUE(field_m);
    const Equilibrium full = statics.solve(young, nu, a, b);
    EXPECT_LT((*field_m - full.displacement_m).norm(), 1e-6 * full.displacement_m.norm()) << nu;
    EXPECT_EQ(statics.inverted_elements(*field_m), full.inverted_elements);
    most = std::max(most, full.inverted_elements);
    EXPECT_FALSE(without.displacement_m(nu, a / young, b));
  }
  EXPECT_GT(most, 0);
  EXPECT_FALSE(response.displacement_m(range.poisson_upper + 1e-3, a, b));
}

TEST_P(LinearResponseContract, SpansNothingWhereNothingActs) {
  Boundary held = driven();
  held.forces.resize(held.forces.rows(), 0);
  held.motions.resize(held.motions.rows(), 0);
  const Statics statics(mesh, "linear", held, options);
  const LinearResponse response(statics, everything(), range);
  const double middle = 0.5 * (range.poisson_lower + range.poisson_upper);
  for (const double nu : {middle, range.poisson_lower, range.poisson_upper}) EXPECT_EQ(response.at(nu)->force.cols(), 0);
  EXPECT_EQ(response.span(static_cast<Index>(everything().rows()), middle), nullptr);
}

INSTANTIATE_TEST_SUITE_P(Elements, LinearResponseContract,
                         testing::Values(Case{4, Dilatation::pointwise, 0, 0.49}, Case{4, Dilatation::averaged, 0.05, 0.499},
                                         Case{10, Dilatation::pointwise, -0.5, 0.45},
                                         Case{10, Dilatation::averaged, 0, 0.4999}),
                         [](const auto& each) {
                           return "tet" + std::to_string(each.param.nodes) +
                                  (each.param.dilatation == Dilatation::averaged ? "_averaged" : "");
                         });

}  // namespace
}  // namespace palpate::fem::linear_response_test
