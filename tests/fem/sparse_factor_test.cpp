// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/sparse_factor.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <limits>
#include <ostream>

#include "fem/lattice.hpp"
#include "palpate/core/error.hpp"

namespace palpate::fem::sparse_factor_test {
namespace {

using test::dense_of;
using test::lattice_matrix;
using test::random_matrix;

double relative_residual(const Eigen::SparseMatrix<double>& lower, const MatrixX& x, const MatrixX& b) {
  return (lower.selfadjointView<Eigen::Lower>() * x - b).norm() / b.norm();
}

struct Shape {
  int nx, ny, nz;
};
void PrintTo(const Shape& shape, std::ostream* out) { *out << shape.nx << " x " << shape.ny << " x " << shape.nz; }

class EverySize : public testing::TestWithParam<Shape> {};

TEST_P(EverySize, AgreesWithTheDenseSolution) {
  const Shape shape = GetParam();
  const auto lower = lattice_matrix(shape.nx, shape.ny, shape.nz);
  SparseFactor factor;
  factor.analyse(lower);
  ASSERT_TRUE(factor.factorise(lower));
  const MatrixX b = random_matrix(lower.rows(), 2, 7);
  MatrixX x = b;
  factor.solve_in_place(x);
  const MatrixX expected = dense_of(lower).llt().solve(b);
  EXPECT_LT((x - expected).norm(), 1e-11 * expected.norm());
}

INSTANTIATE_TEST_SUITE_P(Shapes, EverySize,
                         testing::Values(Shape{1, 1, 1}, Shape{2, 1, 1}, Shape{5, 1, 1}, Shape{3, 3, 1}, Shape{3, 3, 3},
                                         Shape{4, 5, 6}, Shape{8, 8, 8}, Shape{60, 3, 1}));

TEST(SparseFactor, LargeSystemHasASmallResidual) {
  const auto lower = lattice_matrix(14, 14, 14);
  SparseFactor factor;
  factor.analyse(lower);
  ASSERT_TRUE(factor.factorise(lower));
  const MatrixX b = random_matrix(lower.rows(), 1, 3);
  MatrixX x = b;
  factor.solve_in_place(x);
  EXPECT_LT(relative_residual(lower, x, b), 1e-12);
}

TEST(SparseFactor, SolvesManyRightHandSidesLikeOneAtATime) {
  const auto lower = lattice_matrix(6, 6, 6);
  SparseFactor factor;
  factor.analyse(lower);
  ASSERT_TRUE(factor.factorise(lower));
  for (const int count : {1, 2, 3, 7, 8, 9, 16, 37}) {
    const MatrixX b = random_matrix(lower.rows(), count, 11);
    MatrixX together = b;
    factor.solve_in_place(together);
    for (int column = 0; column < count; ++column) {
      MatrixX alone = b.col(column);
      factor.solve_in_place(alone);
      EXPECT_LT((together.col(column) - alone).norm(), 1e-12 * alone.norm());
    }
  }
  MatrixX none(lower.rows(), 0);
  EXPECT_NO_THROW(factor.solve_in_place(none));
}

TEST(SparseFactor, SolvesInsideALargerMatrix) {
  const auto lower = lattice_matrix(4, 4, 4);
  SparseFactor factor;
  factor.analyse(lower);
  ASSERT_TRUE(factor.factorise(lower));
  MatrixX frame = random_matrix(lower.rows() + 5, 4, 5);
  const MatrixX before = frame;
  factor.solve_in_place(frame.block(2, 1, lower.rows(), 2));
  EXPECT_LT(relative_residual(lower, frame.block(2, 1, lower.rows(), 2), before.block(2, 1, lower.rows(), 2)), 1e-12);
  EXPECT_EQ(frame.topRows(2), before.topRows(2));
  EXPECT_EQ(frame.bottomRows(3), before.bottomRows(3));
  EXPECT_EQ(frame.col(3), before.col(3));
}

TEST(SparseFactor, OneAnalysisServesManyMatrices) {
  SparseFactor factor;
  factor.analyse(lattice_matrix(5, 5, 5));
  for (unsigned seed = 1; seed < 5; ++seed) {
    const auto lower = lattice_matrix(5, 5, 5, 0.1 * seed, seed);
    ASSERT_TRUE(factor.factorise(lower));
    const MatrixX b = random_matrix(lower.rows(), 1, seed);
    MatrixX x = b;
    factor.solve_in_place(x);
    EXPECT_LT(relative_residual(lower, x, b), 1e-12);
  }
}

TEST(SparseFactor, NodesMayHaveLostUnknownsToSupports) {
  const auto lower = lattice_matrix(5, 5, 5, 0.0, 1, {0, 1, 2, 4, 9, 10, 77, 200, 201, 371});
  for (const int block : {1, 2, 3, 6}) {
    SparseFactor factor({.block = block});
    factor.analyse(lower);
    ASSERT_TRUE(factor.factorise(lower));
    const MatrixX b = random_matrix(lower.rows(), 3, 2);
    MatrixX x = b;
    factor.solve_in_place(x);
    EXPECT_LT(relative_residual(lower, x, b), 1e-12);
  }
}

TEST(SparseFactor, SeparateBodiesInOneMatrix) {
  const auto one = lattice_matrix(4, 4, 4), two = lattice_matrix(7, 3, 3);
  std::vector<Eigen::Triplet<double>> entries;
  for (int column = 0; column < one.outerSize(); ++column) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(one, column); it; ++it)
      entries.emplace_back(it.row(), it.col(), it.value());
  }
  for (int column = 0; column < two.outerSize(); ++column) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(two, column); it; ++it) {
      entries.emplace_back(one.rows() + it.row(), one.rows() + it.col(), it.value());
    }
  }
  Eigen::SparseMatrix<double> both(one.rows() + two.rows(), one.rows() + two.rows());
  both.setFromTriplets(entries.begin(), entries.end());
  SparseFactor factor;
  factor.analyse(both);
  ASSERT_TRUE(factor.factorise(both));
  const MatrixX b = random_matrix(both.rows(), 1, 2);
  MatrixX x = b;
  factor.solve_in_place(x);
  EXPECT_LT(relative_residual(both, x, b), 1e-12);
}

TEST(SparseFactor, CholeskySaysWhenTheMatrixIsNotPositiveDefinite) {
  const auto indefinite = lattice_matrix(8, 8, 8, -1.0), definite = lattice_matrix(8, 8, 8);
  SparseFactor factor;
  factor.analyse(definite);
  EXPECT_FALSE(factor.factorise(indefinite));
  MatrixX b = random_matrix(definite.rows(), 1, 2);
  EXPECT_THROW(factor.solve_in_place(b), Error);
  EXPECT_TRUE(factor.factorise(definite)) << "a failed factorisation must leave nothing behind";
  EXPECT_NO_THROW(factor.solve_in_place(b));
}

TEST(SparseFactor, AFreeBodyIsNotPositiveDefinite) {
  // Without the springs to the ground the rigid translations remain: rounding must not pass for stiffness.
  for (const int edge : {2, 4, 8}) {
    const auto free = lattice_matrix(edge, edge, edge, -0.05);
    SparseFactor factor;
    factor.analyse(free);
    EXPECT_FALSE(factor.factorise(free));
  }
}

TEST(SparseFactor, NotANumberIsNotPositiveDefinite) {
  auto lower = lattice_matrix(6, 6, 6);
  SparseFactor factor;
  factor.analyse(lower);
  lower.valuePtr()[lower.nonZeros() / 2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(factor.factorise(lower));
}

TEST(SparseFactor, IndefiniteModeCountsNegativeEigenvalues) {
  for (const double shift : {0.0, -0.3, -1.0, -3.0, -30.0}) {
    const auto lower = lattice_matrix(6, 6, 6, shift);
    SparseFactor factor({.indefinite = true});
    factor.analyse(lower);
    ASSERT_TRUE(factor.factorise(lower));
    const Eigen::SelfAdjointEigenSolver<MatrixX> eigen(dense_of(lower), Eigen::EigenvaluesOnly);
    EXPECT_EQ(factor.negative_pivots(), (eigen.eigenvalues().array() < 0).count());  // Sylvester's law of inertia
    const MatrixX b = random_matrix(lower.rows(), 2, 4);
    MatrixX x = b;
    factor.solve_in_place(x);
    EXPECT_LT(relative_residual(lower, x, b), 1e-9);
  }
}

TEST(SparseFactor, SaysWhatIsWrong) {
  SparseFactor factor;
  const auto lower = lattice_matrix(3, 3, 3);
  EXPECT_THROW(factor.factorise(lower), Error);
  factor.analyse(lower);
  EXPECT_THROW(factor.factorise(lattice_matrix(4, 3, 3)), Error);
  ASSERT_TRUE(factor.factorise(lower));
  MatrixX wrong = random_matrix(lower.rows() + 1, 1, 1);
  EXPECT_THROW(factor.solve_in_place(wrong), Error);
  const Eigen::SparseMatrix<double> full = lower.selfadjointView<Eigen::Lower>();
  EXPECT_THROW(factor.analyse(full), Error);
  Eigen::SparseMatrix<double> hollow = lower;
  hollow.prune([](Eigen::Index r, Eigen::Index c, double) { return r != 5 || c != 5; });
  EXPECT_THROW(factor.analyse(hollow), Error);
}

}  // namespace
}  // namespace palpate::fem::sparse_factor_test
