// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>

#include "palpate/fem/linear_solver/preconditioner.hpp"

namespace palpate::fem {

/// How long to go on. From step `first_look` on, every 50 steps, the fall of the residual over the last half of all steps says
/// how many are left: more than `worth` of them are not waited for.
struct Patience {
  int max_iterations = 5000;
  int first_look = std::numeric_limits<int>::max();
  double worth = 0;
};

struct ConjugateGradientsResult {
  bool converged = false;
  bool negative_curvature = false;  ///< the matrix is not positive definite
  int iterations = 0;
  double steps_left = 0;  ///< that were too many to wait for (Patience)
  double residual = 0;  ///< true residual over the norm of b
};

/// Preconditioned conjugate gradients (Hestenes & Stiefel 1952) on padded vectors. Sums are taken aggregate by aggregate, so
/// every number of threads gives the same bits. The true residual is formed at the end; where it lags behind the recursion
/// the iteration starts again from the best point.
/// @param b  padded right-hand side
/// @param x  padded start and result
ConjugateGradientsResult conjugate_gradients(const BlockMatrix& matrix, const Aggregates& aggregates,
                                             Preconditioner& preconditioner, const VectorX& b, VectorX& x, double tolerance,
                                             const Patience& patience, int threads);

}  // namespace palpate::fem
