// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/fem/linear_solver/preconditioner.hpp"

namespace palpate::fem {

struct ConjugateGradientsResult {
  bool converged = false;
  bool negative_curvature = false;  ///< the matrix is not positive definite
  int iterations = 0;
  double residual = 0;  ///< true residual over the norm of b
};

/// Preconditioned conjugate gradients (Hestenes & Stiefel 1952) on padded vectors. Sums are taken aggregate by aggregate, so
/// every number of threads gives the same bits. The true residual is formed at the end; where it lags behind the recursion
/// the iteration starts again from the best point.
/// @param b  padded right-hand side
/// @param x  padded start and result
/// @param extension  goes on beyond max_iterations while the mean fall of the residual so far promises the end within as many
///                   further steps
ConjugateGradientsResult conjugate_gradients(const BlockMatrix& matrix, const Aggregates& aggregates,
                                             Preconditioner& preconditioner, const VectorX& b, VectorX& x, double tolerance,
                                             int max_iterations, int extension, int threads);

}  // namespace palpate::fem
