// label: oracle
// SPDX-License-Identifier: Apache-2.0
// A column under more than Euler's load has three equilibria: straight, and bent to both sides (elastica). Whichever is
// found, the others must be noticed and said. Tip of the elastica: Timoshenko and Gere, Theory of Elastic Stability, table
// 2-1.
#include <gtest/gtest.h>

#include <cmath>

#include "fem_meshes.hpp"
#include "palpate/fem/response.hpp"

namespace palpate::fem::two_equilibria_test {
namespace {

constexpr double kYoung = 20e3, kLength = 0.4, kWidth = 0.02, kDepth = 0.03;

class Column : public testing::Test {
 protected:
  Column() : mesh(to_quadratic(block_mesh(2, 2, 24, {kWidth, kDepth, kLength}))) {
    for (Index i :
         nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; })) {  // the plane of the section, not its width
      const Vec3 x = node_position(mesh, i);
      Constraint c{i, Mat3::Zero(), 1};
      c.axes.col(0) = Vec3::UnitZ();
      if (std::abs(x.x() - kWidth / 2) < 1e-9) c.axes.col(c.count++) = Vec3::UnitX();
      if (std::abs(x.y() - kDepth / 2) < 1e-9) c.axes.col(c.count++) = Vec3::UnitY();
      boundary.constraints.push_back(c);
    }
    boundary.forces = spread_over_nodes(static_cast<Index>(mesh.nodes_m.rows()),
                                        nodes_where(mesh, [](const Vec3& x) { return x.z() > kLength - 1e-9; }));
    tip = nearest_node(mesh, {kWidth / 2, kDepth / 2, kLength});
  }
  static double euler_n() {
    return EIGEN_PI * EIGEN_PI * kYoung * kDepth * std::pow(kWidth, 3) / 12 / (4 * kLength * kLength);
  }
  // Straight and shortened, as Newton's method finds it where nothing pushes aside.
  Equilibrium straight(const Statics& statics, double load_n) const {
    const VectorX start = squeezed(load_n);
    return statics.solve(kYoung, 0.3, Vec3(0, 0, -load_n), VectorX(0), &start);
  }
  /// Shorter, not bent.
  VectorX squeezed(double load_n) const {
    VectorX start(3 * mesh.nodes_m.rows());
    const double strain = load_n / (kYoung * kWidth * kDepth);
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
      const Vec3 x = node_position(mesh, i);
      start.segment<3>(3 * i) = strain * Vec3(0.3 * (x.x() - kWidth / 2), 0.3 * (x.y() - kDepth / 2), -x.z());
    }
    return start;
  }
  TetMesh mesh;
  Boundary boundary;
  Index tip = 0;
};

TEST_F(Column, BelowEulersLoadThereIsOneState) {
  const Statics statics(mesh, "neo_hookean", boundary);
  const Equilibrium e = straight(statics, 0.9 * euler_n());
  ASSERT_TRUE(e.converged) << e.reason;
  EXPECT_FALSE(e.unstable);
  EXPECT_TRUE(e.reason.empty()) << e.reason;
  EXPECT_TRUE(statics.is_stable(e));
  EXPECT_TRUE(statics.other_equilibria(e).empty());
}

TEST_F(Column, AboveItTheOthersAreFoundAndSaid) {
  const Statics statics(mesh, "neo_hookean", boundary);
  const double load_n = 1.152 * euler_n();  // the end turns by 60 degrees
  const Equilibrium e = straight(statics, load_n);
  ASSERT_TRUE(e.converged) << e.reason;
  ASSERT_LT(std::abs(e.displacement_m(3 * tip)), 0.05 * kLength) << "the straight state was left";
  EXPECT_TRUE(e.unstable);
  EXPECT_NE(e.reason.find("unstable"), std::string::npos) << e.reason;
  EXPECT_FALSE(statics.is_stable(e));
  const std::vector<Equilibrium> others = statics.other_equilibria(e);
  ASSERT_EQ(others.size(), 2u);
  for (const Equilibrium& other : others) {
    EXPECT_TRUE(statics.is_stable(other));
    EXPECT_FALSE(other.unstable);
    EXPECT_NEAR(std::abs(other.displacement_m(3 * tip)), 0.593 * kLength, 0.03 * kLength);
    EXPECT_NEAR(kLength + other.displacement_m(3 * tip + 2), 0.741 * kLength, 0.03 * kLength);
  }
  EXPECT_LT(others[0].displacement_m(3 * tip) * others[1].displacement_m(3 * tip), 0);
}

TEST_F(Column, ACertificateSaysSo) {
  Eigen::SparseMatrix<double> watched = boundary.forces.transpose();
  Response::Options options;
  const Response response(mesh, "neo_hookean", boundary, watched, options);
  for (const double share : {0.8, 1.3}) {
    const Vec3 force(0, 0, -share * euler_n());
    const ResponseQuery query{kYoung, 0.3, force, VectorX(0)};
    const ResponseState state = response.at(query);
    ASSERT_TRUE(state.converged) << state.reason;
    const Certificate c = response.certify(state, query);
    // Above the load the state that is found may be a bent one: then it is stable, and no other was met on the way.
    if (share < 1) {
      EXPECT_TRUE(c.stable);
      EXPECT_FALSE(c.second_equilibrium);
    } else {
      EXPECT_EQ(c.second_equilibrium, !c.stable);
    }
  }
}

// Whichever the full solve finds, straight or bent: an answer that is straight where a column buckles is not the only one.
TEST_F(Column, ACertificateOfTheStraightStateSaysSo) {
  Eigen::SparseMatrix<double> watched(3 * mesh.nodes_m.rows(), 3 * mesh.nodes_m.rows());
  watched.setIdentity();
  const Response response(mesh, "neo_hookean", boundary, watched, {});
  for (const double share : {0.9, 1.152}) {
    const double load_n = share * euler_n();
    const VectorX start_m = squeezed(load_n);
    ResponseQuery query{kYoung, 0.3, Vec3(0, 0, -load_n), VectorX(0)};
    query.derivatives = false;
    ResponseStart start;
    start.displacement_m = &start_m;
    const ResponseState straight = response.solve(query, start);
    ASSERT_TRUE(straight.converged) << straight.reason;
    ASSERT_LT(std::abs(straight.watched_m(3 * tip)), 0.05 * kLength) << "the straight state was left";
    EXPECT_EQ(response.certify(straight, query).second_equilibrium, share > 1) << share;
  }
}

}  // namespace
}  // namespace palpate::fem::two_equilibria_test
