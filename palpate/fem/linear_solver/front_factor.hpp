// SPDX-License-Identifier: Apache-2.0
// Numeric side of the multifrontal factorisation P A P' = L D L'.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "palpate/core/math.hpp"
#include "palpate/fem/linear_solver/dense_kernels.hpp"
#include "palpate/fem/linear_solver/front_tree.hpp"
#include "palpate/fem/linear_solver/large_array.hpp"
#include "palpate/fem/linear_solver/thread_team.hpp"

namespace palpate::fem {

/// T is double, or float for a preconditioner of half the size. The arithmetic of a front does not depend on which thread
/// does it, so every number of threads gives the same bits.
template <class T>
class FrontFactor {
 public:
  FrontFactor(std::shared_ptr<const FrontTree> tree, int threads, const DenseKernels<T>& kernels = dense_kernels<T>());
  ~FrontFactor();

  /// @param values    of the matrix whose pattern built the tree
  /// @param definite  refuse a pivot that is not positive, or has lost all its digits to cancellation
  /// @return false: a pivot was refused (indefinite: it was zero or not finite); there is no factor then
  bool factorise(const double* values, bool definite);

  /// In place; column c starts at columns + c * stride. Many columns are shared among the threads.
  void solve(double* columns, Eigen::Index count, Eigen::Index stride) const;

  int negative_pivots() const { return negative_; }
  const FrontTree& tree() const { return *tree_; }
  std::size_t bytes() const;  ///< of the factor and its working memory

 private:
  struct Update {  // where a front's update lives
    std::size_t offset = 0;
    int stack = 0;  // 0, 1: the stacks of whoever works on it; 2: kept until the fronts above all tasks are done
  };
  struct Task {  // fronts [first, root], one subtree
    Index first, root;
  };
  struct Workspace;
  void plan(int threads);
  bool process(Index front, const double* values, bool definite, Workspace& workspace, const ThreadTeam& team,
               int& pivots_done);
  void sweep(double* columns, Eigen::Index stride, int used, int width, T* x, T* work) const;
  T* update_of(Index front, const Workspace& workspace) const;

  std::shared_ptr<const FrontTree> tree_;
  const DenseKernels<T>& kernels_;
  std::vector<Update> updates_;
  std::vector<Task> tasks_;  // largest first
  std::vector<Index> top_;   // fronts of no task, children before parents
  std::size_t task_stack_[2] = {0, 0}, top_stack_[2] = {0, 0}, kept_size_ = 0;
  std::size_t strip_size_[2] = {0, 0}, panel_size_[2] = {0, 0};  // packed operands: of tasks, of the top
  int threads_;
  LargeArray<T> values_, inverse_pivots_, floor_, kept_;
  std::vector<std::unique_ptr<Workspace>> workspaces_;
  int negative_ = 0;
};

extern template class FrontFactor<double>;
extern template class FrontFactor<float>;

}  // namespace palpate::fem
