// label: contract
// SPDX-License-Identifier: Apache-2.0
// Derivatives of a Response to what else is unknown of a contact: against differences of full solutions with the patch
// itself moved, widened and its force turned, against differences of the answer, and a column on springs in closed form.
#include "palpate/fem/response_nuisances.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "fem_meshes.hpp"

namespace palpate::fem::response_nuisances_test {
namespace {

const double kYoung = 20e3, kPoisson = 0.35;

class NuisanceContract : public testing::TestWithParam<const char*> {
 protected:
  NuisanceContract() : mesh(to_quadratic(block_mesh(5, 5, 3, {0.1, 0.1, 0.06}))) {
    bottom = nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; });
    columns = contact_columns(mesh, centre, radius, -Vec3::UnitZ());
  }
  Response make(bool sprung) const {
    Boundary b;
    b.constraints = clamp(bottom);
    b.forces = columns.forces;
    if (sprung) b.motions = support_motions(mesh, bottom, {0.05, 0.05, 0});
    Eigen::SparseMatrix<double> watched(3 * mesh.nodes_m.rows(), 3 * mesh.nodes_m.rows());
    watched.setIdentity();
    Response::Options options;
    options.statics.residual_tolerance = 1e-12;
    options.poisson_lower = options.poisson_upper = kPoisson;
    return Response(mesh, GetParam(), b, watched, options);
  }
  TetMesh mesh;
  std::vector<Index> bottom;
  Vec3 centre{0.047, 0.052, 0.06};
  double radius = 0.02;
  ContactColumns columns;
};

TEST_P(NuisanceContract, ContactAgreesWithMovedPatches) {
  const Response response = make(false);
  ContactNuisances at;
  at.force_n = 3;
  at.tilt_rad = {0.1, -0.05};
  const auto jacobian_at = [&](const ContactNuisances& n) {
    const auto c = contact_coefficients(columns, n);
    return MatrixX(response.at({kYoung, kPoisson, c.values, VectorX(0)}).d_force() * c.derivatives);
  };
  // Columns shift and widen the force along their own direction: exact where it is not tilted.
  ContactNuisances upright = at;
  upright.tilt_rad.setZero();
  MatrixX jacobian = jacobian_at(upright);
  jacobian.leftCols<3>() = jacobian_at(at).leftCols<3>();
  // The patch and the force themselves, with no column of first order.
  const auto truth = [&](const Vec2& shift, double log_radius, const Vec2& tilt, double force) {
    Boundary b;
    b.constraints = clamp(bottom);
    b.forces = spread_over_patch(mesh, centre + shift(0) * columns.tangent_1 + shift(1) * columns.tangent_2,
                                 radius * std::exp(log_radius));
    ContactNuisances n;
    n.force_n = force;
    n.tilt_rad = tilt;
    StaticsOptions options;
    options.residual_tolerance = 1e-12;
    const Equilibrium e = Statics(mesh, GetParam(), b, options)
                              .solve(kYoung, kPoisson, contact_coefficients(columns, n).values.head<3>(), VectorX(0));
    EXPECT_TRUE(e.converged) << e.reason;
    return e.displacement_m;
  };
  const auto check = [&](const char* what, Index column, double step, double tolerance,
                         const std::function<VectorX(double)>& solved) {
    const VectorX difference = (solved(step) - solved(-step)) / (2 * step);
    EXPECT_LT((difference - jacobian.col(column)).norm(), tolerance * difference.norm()) << what;
  };
  const Vec2 none = Vec2::Zero();
  check("force", 0, 1e-3, 1e-5, [&](double h) { return truth(none, 0, at.tilt_rad, at.force_n + h); });
  for (int k = 0; k < 2; ++k) {
    const Vec2 unit = Vec2::Unit(k);
    check("tilt", 1 + k, 1e-4, 1e-5, [&](double h) { return truth(none, 0, at.tilt_rad + h * unit, at.force_n); });
    // A column is a difference over a tenth of the radius, and the patch's rim is sub-sampled.
    check("shift", 3 + k, 0.05 * radius, 0.02, [&](double h) { return truth(h * unit, 0, none, at.force_n); });
  }
  check("radius", 5, 0.05, 0.02, [&](double h) { return truth(none, h, none, at.force_n); });
}

// A column that may bulge freely on a spring: its top goes down by F L / (E A) and F / k.
TEST_P(NuisanceContract, SpringUnderAColumnInClosedForm) {
  Boundary b;
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    const Vec3 x = node_position(mesh, i);
    Constraint c{i, Mat3::Zero(), 0};
    if (x.z() < 1e-9) c.axes.col(c.count++) = Vec3::UnitZ();
    if (x.x() < 1e-9) c.axes.col(c.count++) = Vec3::UnitX();
    if (x.y() < 1e-9) c.axes.col(c.count++) = Vec3::UnitY();
    if (c.count > 0) b.constraints.push_back(c);
  }
  b.motions = Eigen::SparseMatrix<double>(support_motions(mesh, bottom, Vec3::Zero()).middleCols(2, 1));
  const Tetrahedra faces = boundary_faces(mesh);
  VectorX load = VectorX::Zero(3 * mesh.nodes_m.rows());
  for (Index f = 0; f < faces.rows(); ++f) {
    const auto z = [&](int a) { return mesh.nodes_m(faces(f, a), 2); };
    if (std::min({z(0), z(1), z(2)}) < 0.06 - 1e-9) continue;
    const Vec3 p = node_position(mesh, faces(f, 0)), q = node_position(mesh, faces(f, 1)),
               r = node_position(mesh, faces(f, 2));
    for (int a = 3; a < 6; ++a) load(3 * faces(f, a) + 2) -= (q - p).cross(r - p).norm() / 6 / 0.01;
  }
  b.forces = load.sparseView();
  const Eigen::SparseMatrix<double> watched = b.forces.transpose();
  const Response response(mesh, GetParam(), b, watched, Response::Options{});
  const double force_n = 0.02, spring = 500;  // 1e-4 of strain
  const SprungState s =
      on_springs(response, {kYoung, kPoisson, VectorX::Constant(1, force_n), VectorX::Zero(1)}, VectorX::Constant(1, spring));
  ASSERT_TRUE(s.state.converged) << s.state.reason;
  const double body = force_n * 0.06 / (kYoung * 0.01), gives = force_n / spring;
  EXPECT_NEAR(s.state.watched_m(0), body + gives, 1e-3 * body);
  EXPECT_NEAR(s.support_motion(0), -gives, 1e-9 * gives);
  EXPECT_NEAR(s.d_log_stiffness(0, 0), -gives, 1e-6 * gives);
  EXPECT_NEAR(s.state.d_watched(0, 0), -body, 2e-3 * body);
  EXPECT_NEAR(s.state.reaction_n(0), force_n, 1e-9);
}

TEST_P(NuisanceContract, SpringsAgreeWithDifferences) {
  const Response response = make(true);
  struct Point {
    double log_young = std::log(kYoung), poisson = kPoisson;
    VectorX force = VectorX(6), motion = VectorX::Zero(6), log_stiffness = VectorX(6);
  } at;
  at.force << 0.3, 0, -3, 0, 0.004, 0;
  at.motion << 0, 0, -0.001, 0.002, 0, 0;
  at.log_stiffness << std::log(3e3), std::log(2e3), std::log(5e3), std::log(8.0), std::log(6.0), std::log(2.0);
  const auto solve = [&](const Point& p) {
    SprungState s =
        on_springs(response, {std::exp(p.log_young), p.poisson, p.force, p.motion}, p.log_stiffness.array().exp().matrix());
    EXPECT_TRUE(s.state.converged) << s.state.reason;
    return s;
  };
  const SprungState s = solve(at);
  const VectorX carried = at.log_stiffness.array().exp() * (s.support_motion - at.motion).array();
  EXPECT_LT((s.state.reaction_n + carried).norm(), 1e-7 * carried.norm());
  const auto check = [&](const char* what, double step, const VectorX& exact, const VectorX& exact_reaction,
                         const std::function<void(Point&, double)>& change) {
    Point up = at, down = at;
    change(up, step);
    change(down, -step);
    const SprungState a = solve(up), b = solve(down);
    const VectorX du = (a.state.watched_m - b.state.watched_m) / (2 * step);
    const VectorX dr = (a.state.reaction_n - b.state.reaction_n) / (2 * step);
    EXPECT_LT((du - exact).norm(), 2e-5 * du.norm() + 1e-9 * s.state.watched_m.norm()) << what;
    EXPECT_LT((dr - exact_reaction).norm(), 2e-5 * dr.norm() + 1e-7 * s.state.reaction_n.norm()) << what;
  };
  check("log E", 1e-4, s.state.d_watched.col(0), s.state.d_reaction.col(0), [](Point& p, double h) { p.log_young += h; });
  check("nu", 1e-4, s.state.d_watched.col(1), s.state.d_reaction.col(1), [](Point& p, double h) { p.poisson += h; });
  for (Index k = 0; k < 6; ++k) {
    check("force", 1e-3, s.state.d_force().col(k), s.state.reaction_d_force().col(k),
          [k](Point& p, double h) { p.force(k) += h; });
    check("motion", 1e-5, s.state.d_motion().col(k), s.state.reaction_d_motion().col(k),
          [k](Point& p, double h) { p.motion(k) += h; });
    check("stiffness", 1e-3, s.d_log_stiffness.col(k), s.reaction_d_log_stiffness.col(k),
          [k](Point& p, double h) { p.log_stiffness(k) += h; });
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, NuisanceContract, testing::Values("linear", "neo_hookean"),
                         [](const auto& each) { return std::string(each.param); });

}  // namespace
}  // namespace palpate::fem::response_nuisances_test
