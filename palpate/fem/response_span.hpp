// SPDX-License-Identifier: Apache-2.0
// What a linear body's answers to unit loads have in common over all nu: a few fields, whose shares follow nu. Whoever knows what
// a quadratic form says of the fields need not ask it of every vertex again.
#pragma once

#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::fem {

struct ResponseSpan {
  MatrixX fields;               ///< rows x fields, m at E = 1: those of unit load 0 (forces first, then motions), of unit load 1, ...
  VectorX reach_m;              ///< a field: length of the longest three of its rows that belong together, a vertex's
  std::vector<Index> first;     ///< a unit load: its first field; one more at the end
  std::vector<MatrixX> share;   ///< a unit load: its fields x terms of the polynomial in z = -log(1 - 2 nu)
  double middle = 0, half = 1;  ///< of the polynomial's range of z

  Index count_of(Index load) const { return first[static_cast<std::size_t>(load) + 1] - first[static_cast<std::size_t>(load)]; }

  struct Terms {
    VectorX value, d_poisson;  ///< of the polynomial
  };
  Terms terms_at(double poisson_ratio) const;
};

/// @param coefficients  of Chebyshev polynomials in z: the first `rows` rows are spanned, a unit load a column
/// What is left out is 3e-8 of a unit load's own size, far below what the polynomial errs by.
ResponseSpan span_of(const std::vector<MatrixX>& coefficients, Index rows, double middle, double half);

}  // namespace palpate::fem
