// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/front_factor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>

#include "fem/lattice.hpp"
#include "palpate/fem/linear_solver/elimination_order.hpp"

namespace palpate::fem::front_factor_test {
namespace {

using test::lattice_matrix;
using test::random_matrix;

std::shared_ptr<const FrontTree> tree_of(const Eigen::SparseMatrix<double>& lower) {
  return std::make_shared<const FrontTree>(build_front_tree(lower, 3));
}

double relative_residual(const Eigen::SparseMatrix<double>& lower, const MatrixX& x, const MatrixX& b) {
  return (lower.selfadjointView<Eigen::Lower>() * x - b).norm() / b.norm();
}

TEST(FrontTree, EliminatesEveryUnknownOnceAndKeepsEveryEntry) {
  const auto lower = lattice_matrix(9, 7, 6);
  const FrontTree tree = build_front_tree(lower, 3);
  const std::set<Index> positions(tree.position.begin(), tree.position.end());
  EXPECT_EQ(positions.size(), static_cast<std::size_t>(lower.cols()));
  EXPECT_EQ(*positions.begin(), 0);
  EXPECT_EQ(*positions.rbegin(), lower.cols() - 1);
  EXPECT_EQ(tree.entries.size(), static_cast<std::size_t>(lower.nonZeros()));
  Index next = 0;
  for (std::size_t f = 0; f < tree.fronts.size(); ++f) {
    const auto& front = tree.fronts[f];
    EXPECT_EQ(front.first, next);
    next += front.pivots;
    if (front.parent >= 0) {
      EXPECT_GT(front.parent, static_cast<Index>(f));
    } else {
      EXPECT_EQ(front.below(), 0);
    }
    EXPECT_TRUE(std::is_sorted(tree.rows.begin() + static_cast<std::ptrdiff_t>(front.rows),
                               tree.rows.begin() + static_cast<std::ptrdiff_t>(front.rows) + front.below()));
  }
  EXPECT_EQ(next, lower.cols());
}

TEST(FrontTree, OrdersReduceFill) {
  // Bars numbered along their length: eliminated in that order they would take n * bandwidth^2 operations.
  for (const auto& [length, width] : {std::pair{40, 3}, {40, 5}, {60, 6}}) {
    const auto lower = lattice_matrix(length, width, width);
    const double bandwidth = 3.0 * length * width;
    EXPECT_LT(build_front_tree(lower, 3).flops, 0.1 * static_cast<double>(lower.cols()) * bandwidth * bandwidth) << width;
    const QuotientGraph graph = quotient_graph(lower, 3);
    EXPECT_EQ(graph.group_count(), length * width * width);
    for (auto order : {minimum_degree_order(graph), nested_dissection_order(graph)}) {
      EXPECT_FALSE(std::is_sorted(order.begin(), order.end())) << width;
      std::sort(order.begin(), order.end());
      for (Index i = 0; i < graph.group_count(); ++i) ASSERT_EQ(order[static_cast<std::size_t>(i)], i);
    }
  }
}

template <class T>
class EveryKernel : public testing::Test {};
using Scalars = testing::Types<double, float>;
TYPED_TEST_SUITE(EveryKernel, Scalars);

TYPED_TEST(EveryKernel, SolvesOneAndManyAndCountsSigns) {
  for (const double shift : {0.0, -1.0}) {
    for (const int edge : {1, 2, 3, 5, 10}) {
      const auto lower = lattice_matrix(edge, edge + 1, edge, shift);
      const auto tree = tree_of(lower);
      int negative = -1;
      for (const auto* kernels : runnable_dense_kernels<TypeParam>()) {
        FrontFactor<TypeParam> factor(tree, 1, *kernels);
        ASSERT_TRUE(factor.factorise(lower.valuePtr(), shift == 0)) << kernels->name;
        if (negative < 0) negative = factor.negative_pivots();
        EXPECT_EQ(factor.negative_pivots(), negative) << kernels->name;
        EXPECT_EQ(negative > 0, shift < 0);
        for (const int count : {1, 2, 40}) {
          const MatrixX b = random_matrix(lower.rows(), count, 5);
          MatrixX x = b;
          factor.solve(x.data(), x.cols(), x.rows());
          const double digits = std::is_same_v<TypeParam, double> ? 1e-12 : 1e-3;
          EXPECT_LT(relative_residual(lower, x, b), shift == 0 ? digits : 1e3 * digits) << kernels->name << " " << edge;
        }
      }
    }
  }
}

TEST(FrontFactor, ThreadsDoNotChangeABit) {
  const auto lower = lattice_matrix(13, 13, 13);
  const auto tree = tree_of(lower);
  const MatrixX b = random_matrix(lower.rows(), 3, 5);
  MatrixX alone = b;
  {
    FrontFactor<double> factor(tree, 1);
    ASSERT_TRUE(factor.factorise(lower.valuePtr(), true));
    factor.solve(alone.data(), 3, alone.rows());
  }
  for (const int threads : {2, 3, 4}) {
    FrontFactor<double> factor(tree, threads);
    for (int repeat = 0; repeat < 3; ++repeat) {
      ASSERT_TRUE(factor.factorise(lower.valuePtr(), true));
      MatrixX together = b;
      factor.solve(together.data(), 3, together.rows());
      EXPECT_EQ(together, alone) << threads;
    }
  }
}

TEST(FrontFactor, ThreadsAgreeThatAMatrixIsNotDefinite) {
  // The shift spoils the last pivots, so the refusal comes from the part of the tree that the threads share.
  for (const double shift : {-0.045, -0.1, -2.0}) {
    const auto lower = lattice_matrix(13, 13, 13, shift);
    const auto tree = tree_of(lower);
    FrontFactor<double> one(tree, 1), two(tree, 2);
    const bool definite = one.factorise(lower.valuePtr(), true);
    EXPECT_EQ(two.factorise(lower.valuePtr(), true), definite);
    ASSERT_TRUE(one.factorise(lower.valuePtr(), false));
    ASSERT_TRUE(two.factorise(lower.valuePtr(), false));
    EXPECT_EQ(one.negative_pivots(), two.negative_pivots());
    EXPECT_EQ(one.negative_pivots() == 0, definite);
  }
}

}  // namespace
}  // namespace palpate::fem::front_factor_test
