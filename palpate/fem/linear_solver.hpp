// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/SparseCore>
#include <memory>
#include <string>

#include "palpate/core/math.hpp"
#include "palpate/fem/linear_solver/aggregates.hpp"

namespace palpate::fem {

enum class LinearMethod {
  automatic,  ///< the cheapest by size, number of right-hand sides and what earlier solves took
  direct,     ///< factor in double precision (the only one for indefinite matrices)
  mixed,      ///< factor in single precision and conjugate gradients: half the time and memory, full accuracy. Chosen
              ///< automatically, the factor may be that of an earlier matrix as long as that takes less than a new one
  iterative,  ///< conjugate gradients with diagonal blocks and rigid motions of small aggregates
};

const char* name_of(LinearMethod method);

/// Solves A x = b for symmetric A of one pattern after the other: what depends on the pattern alone is done once and only
/// when needed. Every choice is made from counts, never from a clock: the same calls give the same bits, for any number of
/// threads.
class LinearSolver {
 public:
  struct Options {
    LinearMethod method = LinearMethod::automatic;
    bool indefinite = false;  ///< factor L D L' with signs; otherwise a matrix that is not positive definite is refused
    int block = 3;            ///< unknowns a node (1: no block structure)
    int threads = 1;
    double tolerance = 1e-10;  ///< of the residual over the norm of b, checked on every answer but `direct` definite ones
    int max_iterations = 5000;
    int expected = 0;  ///< right-hand sides that come for each matrix, one after the other: what `automatic` may count on
    double memory_limit_bytes = 8e9;  ///< `automatic` never chooses a factor beyond it
  };
  /// What happened; `solved` false is a result, `reason` says why in plain words.
  struct Outcome {
    bool solved = false;
    bool not_positive_definite = false;
    LinearMethod used = LinearMethod::automatic;
    int factorisations = 0;  ///< made for this solve; 0 where an earlier one served, or none was needed
    int iterations = 0;   ///< largest number of any right-hand side (direct: 0)
    double residual = 0;  ///< largest of any right-hand side, relative (direct and definite: not formed, 0)
    std::string reason;
  };

  LinearSolver();
  explicit LinearSolver(Options options);
  ~LinearSolver();
  LinearSolver(LinearSolver&&) noexcept;
  LinearSolver& operator=(LinearSolver&&) noexcept;

  /// @param lower      lower triangle, column-major, compressed, sorted rows, diagonal present
  /// @param placement  where the unknowns act: lets `iterative` use rigid motions (recommended above 10 000 unknowns)
  /// @throws Error when the matrix is not of that form or the placement has not one row for every unknown
  void analyse(const Eigen::SparseMatrix<double>& lower, UnknownPlacement placement = {});

  /// Takes the values of a matrix with the analysed pattern; work starts with the first solve.
  /// @throws Error when the pattern cannot be the analysed one
  void set_matrix(const Eigen::SparseMatrix<double>& lower);

  /// Replaces right-hand sides by solutions (when not solved: by the best that was found, or left as they were).
  /// @param start  starting points of iterative methods, same shape; nullptr: zero
  /// @param tolerance  of this solve; 0: that of the options
  Outcome solve_in_place(Eigen::Ref<MatrixX> right_hand_sides, const MatrixX* start = nullptr, double tolerance = 0);

  /// Negative pivots of the last direct factorisation in indefinite mode (Sylvester: negative eigenvalues).
  int negative_pivots() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::fem
