// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstdint>
#include <ostream>
#include <utility>

#include "benchmarks/cube.hpp"
#include "fem/lattice.hpp"
#include "palpate/core/error.hpp"
#include "palpate/fem/linear_solver/conjugate_gradients.hpp"
#include "palpate/fem/linear_solver/large_array.hpp"

namespace palpate::fem::linear_solver_test {
namespace {

using test::dense_of;
using test::lattice_matrix;
using test::random_matrix;

/// The pressed cube of the benchmarks: stiffness, load, and where its unknowns act.
struct Cube {
  Cube(int n, double poisson_ratio) {
    const TetMesh mesh = benchmark_cube::mesh(n);
    lower = benchmark_cube::stiffness(mesh, n, poisson_ratio);
    load = benchmark_cube::disc_load(mesh, n);
    placement = benchmark_cube::placement(mesh, n);
  }
  double residual(const MatrixX& x) const { return (lower.selfadjointView<Eigen::Lower>() * x - load).norm() / load.norm(); }
  Eigen::SparseMatrix<double> lower;
  MatrixX load;
  UnknownPlacement placement;
};

class EveryMethod : public testing::TestWithParam<LinearMethod> {};

TEST_P(EveryMethod, AgreesWithTheDenseSolution) {
  for (const int edge : {1, 2, 5, 7}) {
    const auto lower = lattice_matrix(edge, edge, edge);
    LinearSolver solver({.method = GetParam(), .tolerance = 1e-12});
    solver.analyse(lower);
    solver.set_matrix(lower);
    const MatrixX b = random_matrix(lower.rows(), 3, 4);
    MatrixX x = b;
    const auto outcome = solver.solve_in_place(x);
    ASSERT_TRUE(outcome.solved) << outcome.reason;
    const MatrixX expected = dense_of(lower).llt().solve(b);
    EXPECT_LT((x - expected).norm(), 1e-9 * expected.norm()) << edge;
    EXPECT_TRUE(GetParam() == LinearMethod::automatic || outcome.used == GetParam());
  }
}

TEST_P(EveryMethod, NodesMayHaveLostUnknownsToSupports) {
  const auto lower = lattice_matrix(6, 5, 5, 0.0, 1, {0, 1, 2, 4, 9, 10, 77, 200, 201, 371});
  LinearSolver solver({.method = GetParam(), .tolerance = 1e-12});
  solver.analyse(lower);
  solver.set_matrix(lower);
  const MatrixX b = random_matrix(lower.rows(), 2, 4);
  MatrixX x = b;
  ASSERT_TRUE(solver.solve_in_place(x).solved);
  EXPECT_LT((lower.selfadjointView<Eigen::Lower>() * x - b).norm(), 1e-11 * b.norm());
}

TEST_P(EveryMethod, SurvivesNearIncompressibility) {
  for (const double poisson_ratio : {0.3, 0.49, 0.499}) {
    const Cube cube(8, poisson_ratio);
    LinearSolver solver({.method = GetParam()});
    solver.analyse(cube.lower, cube.placement);
    solver.set_matrix(cube.lower);
    MatrixX x = cube.load;
    const auto outcome = solver.solve_in_place(x);
    ASSERT_TRUE(outcome.solved) << outcome.reason;
    EXPECT_LT(cube.residual(x), 1e-9);
    EXPECT_TRUE(outcome.used != LinearMethod::mixed || outcome.iterations <= 8) << outcome.iterations;
  }
}

TEST_P(EveryMethod, OneAnalysisServesManyMatricesAndSolves) {
  LinearSolver solver({.method = GetParam()});
  solver.analyse(lattice_matrix(6, 6, 6));
  for (unsigned seed = 1; seed < 4; ++seed) {
    const auto lower = lattice_matrix(6, 6, 6, 0.1 * seed, seed);
    solver.set_matrix(lower);
    for (const int count : {1, 5}) {
      const MatrixX b = random_matrix(lower.rows(), count, seed);
      MatrixX x = b;
      ASSERT_TRUE(solver.solve_in_place(x).solved);
      EXPECT_LT((lower.selfadjointView<Eigen::Lower>() * x - b).norm(), 1e-9 * b.norm());
    }
  }
}

TEST_P(EveryMethod, SaysThatAMatrixIsNotPositiveDefinite) {
  const auto lower = lattice_matrix(7, 7, 7, -1.5);
  LinearSolver solver({.method = GetParam()});
  solver.analyse(lower);
  solver.set_matrix(lower);
  MatrixX x = random_matrix(lower.rows(), 1, 4);
  const auto outcome = solver.solve_in_place(x);
  EXPECT_FALSE(outcome.solved);
  EXPECT_TRUE(outcome.not_positive_definite) << outcome.reason;
  EXPECT_FALSE(outcome.reason.empty());
}

TEST_P(EveryMethod, ThreadsDoNotChangeABit) {
  const Cube cube(13, 0.3);
  MatrixX alone;
  for (const int threads : {1, 2, 3}) {
    LinearSolver solver({.method = GetParam(), .threads = threads});
    solver.analyse(cube.lower, cube.placement);
    solver.set_matrix(cube.lower);
    MatrixX x = cube.load;
    ASSERT_TRUE(solver.solve_in_place(x).solved);
    if (threads == 1) alone = x;
    EXPECT_EQ(x, alone) << threads;
  }
}

TEST_P(EveryMethod, ZeroLoadGivesZero) {
  const auto lower = lattice_matrix(4, 4, 4);
  LinearSolver solver({.method = GetParam()});
  solver.analyse(lower);
  solver.set_matrix(lower);
  MatrixX x = MatrixX::Zero(lower.rows(), 2);
  EXPECT_TRUE(solver.solve_in_place(x).solved);
  EXPECT_EQ(x, MatrixX::Zero(lower.rows(), 2));
}

INSTANTIATE_TEST_SUITE_P(Methods, EveryMethod,
                         testing::Values(LinearMethod::automatic, LinearMethod::direct, LinearMethod::mixed,
                                         LinearMethod::iterative),
                         [](const auto& method) { return std::string(name_of(method.param)); });

TEST(LinearSolver, StepsDoNotGrowWithRefinement) {
  int steps[2] = {0, 0}, without = 0;
  for (const int i : {0, 1}) {
    const Cube cube(i == 0 ? 8 : 16, 0.3);
    LinearSolver solver({.method = LinearMethod::iterative});
    solver.analyse(cube.lower, cube.placement);
    solver.set_matrix(cube.lower);
    MatrixX x = cube.load;
    steps[i] = solver.solve_in_place(x).iterations;
    LinearSolver plain({.method = LinearMethod::iterative});
    plain.analyse(cube.lower);
    plain.set_matrix(cube.lower);
    x = cube.load;
    without = plain.solve_in_place(x).iterations;
  }
  EXPECT_LT(steps[1], 1.3 * steps[0]);
  EXPECT_LT(2 * steps[1], without);
}

TEST(LinearSolver, AggregatesMayLieOnALine) {
  const Cube cube(3, 0.3);
  UnknownPlacement line = cube.placement;
  line.point_m.col(0).setZero();
  line.point_m.col(1).setZero();  // rotations about the line do nothing: the coarse matrix is singular without care
  LinearSolver solver({.method = LinearMethod::iterative});
  solver.analyse(cube.lower, line);
  solver.set_matrix(cube.lower);
  MatrixX x = cube.load;
  const auto outcome = solver.solve_in_place(x);
  EXPECT_TRUE(outcome.solved) << outcome.reason;
  EXPECT_LT(cube.residual(x), 1e-9);
}

TEST(LinearSolver, AGoodStartSavesSteps) {
  const Cube cube(8, 0.3);
  LinearSolver solver({.method = LinearMethod::iterative});
  solver.analyse(cube.lower, cube.placement);
  solver.set_matrix(cube.lower);
  MatrixX x = cube.load;
  const auto first = solver.solve_in_place(x);
  const MatrixX start = 1.001 * x;
  MatrixX y = cube.load;
  const auto second = solver.solve_in_place(y, &start);
  EXPECT_LT(second.iterations, first.iterations);
  EXPECT_LT((x - y).norm(), 1e-7 * x.norm());
}

TEST(LinearSolver, AutomaticTakesTheFactorForSmallSystemsAndManyLoads) {
  const Cube small(6, 0.3), large(16, 0.3);
  LinearSolver solver;
  solver.analyse(small.lower, small.placement);
  solver.set_matrix(small.lower);
  MatrixX x = small.load;
  EXPECT_EQ(solver.solve_in_place(x).used, LinearMethod::direct);
  LinearSolver other;
  other.analyse(large.lower, large.placement);
  other.set_matrix(large.lower);
  x = large.load;
  EXPECT_EQ(other.solve_in_place(x).used, LinearMethod::iterative);
  EXPECT_LT(large.residual(x), 1e-9);
  x = large.load.replicate(1, 40);
  EXPECT_NE(other.solve_in_place(x).used, LinearMethod::iterative);
  EXPECT_LT(large.residual(x.col(39)), 1e-9);
}

TEST(LinearSolver, AutomaticTakesTheFactorForLoadsThatComeOneByOne) {
  const Cube cube(16, 0.3);
  LinearSolver solver;
  solver.analyse(cube.lower, cube.placement);
  for (int matrix = 0; matrix < 2; ++matrix) {
    solver.set_matrix(cube.lower);
    LinearMethod used = LinearMethod::iterative;
    int loads = 0;
    for (; used == LinearMethod::iterative && loads < 60; ++loads) {
      MatrixX x = cube.load;
      used = solver.solve_in_place(x).used;
      EXPECT_LT(cube.residual(x), 1e-9);
    }
    EXPECT_GT(loads, 2) << "one load alone is no reason for a factor";
    EXPECT_NE(used, LinearMethod::iterative);
  }
}

TEST(LinearSolver, AutomaticTakesTheFactorForLoadsThatAreExpected) {
  const Cube cube(16, 0.3);
  LinearSolver solver({.expected = 60});
  solver.analyse(cube.lower, cube.placement);
  solver.set_matrix(cube.lower);
  for (const int factorisations : {1, 0, 0}) {
    MatrixX x = cube.load;
    const auto outcome = solver.solve_in_place(x);
    EXPECT_NE(outcome.used, LinearMethod::iterative);
    EXPECT_EQ(outcome.factorisations, factorisations);
    EXPECT_LT(cube.residual(x), 1e-9);
  }
}

TEST(LinearSolver, AFactorServesTheMatricesThatFollow) {
  // Nearly incompressible: conjugate gradients alone take hundreds of steps.
  const Cube cube(16, 0.4995), near(16, 0.4994), far(16, 0.1);
  LinearSolver solver;
  solver.analyse(cube.lower);
  constexpr double tolerance = 1e-3;  // of a step of Newton's method
  const auto solve = [&](const Cube& of) {
    MatrixX x = of.load;
    const auto outcome = solver.solve_in_place(x, nullptr, tolerance);
    EXPECT_TRUE(outcome.solved) << outcome.reason;
    EXPECT_LT(of.residual(x), 1.01 * tolerance);
    return outcome;
  };
  solver.set_matrix(cube.lower);
  EXPECT_EQ(solve(cube).factorisations, 1);
  solver.set_matrix(near.lower);
  const auto second = solve(near);
  EXPECT_EQ(second.used, LinearMethod::mixed);
  EXPECT_EQ(second.factorisations, 0) << "a few steps more are cheaper than another factor";
  solver.set_matrix(far.lower);
  EXPECT_EQ(solve(far).factorisations, 1) << "here they are not";
  solver.set_matrix(near.lower);
  solve(near);
  Eigen::SparseMatrix<double> negative = -near.lower;
  solver.set_matrix(negative);
  MatrixX x = cube.load;
  EXPECT_TRUE(solver.solve_in_place(x).not_positive_definite);
}

TEST(LinearSolver, AutomaticFallsBackOnTheFactor) {
  // Nearly incompressible and without placement: the steps run out and the factor takes over.
  const Cube cube(16, 0.4995);
  LinearSolver solver;
  solver.analyse(cube.lower);
  solver.set_matrix(cube.lower);
  MatrixX x = cube.load;
  const auto outcome = solver.solve_in_place(x);
  EXPECT_TRUE(outcome.solved) << outcome.reason;
  EXPECT_NE(outcome.used, LinearMethod::iterative);
  EXPECT_LT(cube.residual(x), 1e-9);
}

TEST(ConjugateGradients, StopWhereTheEndIsTooFar) {
  const Cube cube(8, 0.49);
  const QuotientGraph graph = quotient_graph(cube.lower, 3);
  const Aggregates aggregates = aggregate(graph, cube.placement, 16);
  BlockMatrix matrix(cube.lower, graph, aggregates.order);
  matrix.set_values(cube.lower.valuePtr());
  RigidMotionPreconditioner preconditioner(matrix, aggregates, cube.placement);
  ASSERT_TRUE(preconditioner.update());
  VectorX b = VectorX::Zero(matrix.padded_size());
  for (Eigen::Index u = 0; u < cube.load.rows(); ++u) b[matrix.padded()[static_cast<std::size_t>(u)]] = cube.load(u, 0);
  const auto solve = [&](const Patience& patience, int threads, VectorX& x) {
    x.setZero(matrix.padded_size());
    return conjugate_gradients(matrix, aggregates, preconditioner, b, x, 1e-8, patience, threads);
  };
  VectorX whole, x;
  const auto unlimited = solve({}, 1, whole);
  ASSERT_TRUE(unlimited.converged);
  const int look = unlimited.iterations / 2;
  for (const int threads : {1, 2, 3}) {
    const auto patient = solve({.first_look = look, .worth = 2.0 * look}, threads, x);
    EXPECT_TRUE(patient.converged);
    EXPECT_EQ(patient.iterations, unlimited.iterations);
    EXPECT_EQ(x, whole) << threads;
    const auto impatient = solve({.first_look = look, .worth = 0.3 * look}, threads, x);
    EXPECT_FALSE(impatient.converged);
    EXPECT_FALSE(impatient.negative_curvature);
    EXPECT_EQ(impatient.iterations, look);
    EXPECT_NEAR(impatient.steps_left, look, 0.3 * look);
  }
  EXPECT_EQ(solve({.max_iterations = 7}, 1, x).iterations, 7);
}

TEST(LargeArray, IsAlignedAndKeepsWhatItHolds) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{3}, std::size_t{1} << 20}) {
    LargeArray<double> array(size);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(array.data()) % 64, 0U);
    std::fill_n(array.data(), size, 1.0);
    const LargeArray<double> moved = std::move(array);
    EXPECT_TRUE(std::all_of(moved.data(), moved.data() + size, [](double value) { return value == 1.0; }));
  }
  LargeVector<int> growing;
  for (int i = 0; i < 3000000; ++i) growing.push_back(i);
  EXPECT_EQ(growing[2999999], 2999999);
  EXPECT_EQ(growing[12], 12);
}

TEST(LinearSolver, IndefiniteMatricesAreSolvedAndCounted) {
  const auto lower = lattice_matrix(7, 7, 7, -1.5);
  LinearSolver solver({.indefinite = true, .tolerance = 1e-11});
  solver.analyse(lower);
  solver.set_matrix(lower);
  const MatrixX b = random_matrix(lower.rows(), 2, 4);
  MatrixX x = b;
  const auto outcome = solver.solve_in_place(x);
  ASSERT_TRUE(outcome.solved) << outcome.reason;
  EXPECT_LE(outcome.residual, 1e-11);
  EXPECT_GT(solver.negative_pivots(), 0);
}

TEST(LinearSolver, SaysWhatIsWrong) {
  LinearSolver solver;
  const auto lower = lattice_matrix(3, 3, 3);
  MatrixX x = random_matrix(lower.rows(), 1, 1);
  EXPECT_THROW(solver.set_matrix(lower), Error);
  solver.analyse(lower);
  EXPECT_THROW(solver.solve_in_place(x), Error);
  EXPECT_THROW(solver.set_matrix(lattice_matrix(4, 3, 3)), Error);
  solver.set_matrix(lower);
  MatrixX wrong = random_matrix(lower.rows() + 3, 1, 1);
  EXPECT_THROW(solver.solve_in_place(wrong), Error);
  EXPECT_THROW(solver.solve_in_place(x, &wrong), Error);
  UnknownPlacement placement;
  placement.point_m = Points::Zero(4, 3);
  EXPECT_THROW(solver.analyse(lower, placement), Error);
  EXPECT_THROW(LinearSolver({.block = 0}), Error);
  EXPECT_THROW(LinearSolver({.threads = 0}), Error);
  EXPECT_THROW(LinearSolver({.tolerance = 0}), Error);
}

}  // namespace
}  // namespace palpate::fem::linear_solver_test
