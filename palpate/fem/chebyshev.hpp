// SPDX-License-Identifier: Apache-2.0
// Chebyshev polynomials, and the variable in which compliances are smooth in the Poisson ratio.
#pragma once

#include <cmath>

#include "palpate/core/math.hpp"

namespace palpate::fem {

/// z = -log(1 - 2 nu): a compliance has its poles at nu = -1 and where 1 - 2 nu < 0, which is the line Im z = pi.
inline double poisson_to_z(double nu) { return -std::log1p(-2 * nu); }
inline double z_to_poisson(double z) { return -0.5 * std::expm1(-z); }
inline double poisson_d_z(double z) { return 0.5 * std::exp(-z); }

/// T_0 .. T_{count-1} and their derivatives at x; `value` brings the count.
inline void chebyshev(double x, VectorX& value, VectorX& slope) {
  const Index count = static_cast<Index>(value.size());
  slope.resize(count);
  double u_before = 0, u = 1;  // of the second kind: T_i' = i U_{i-1}
  for (Index i = 0; i < count; ++i) {
    value(i) = i == 0 ? 1 : i == 1 ? x : 2 * x * value(i - 1) - value(i - 2);
    slope(i) = 0;
    if (i == 0) continue;
    slope(i) = static_cast<double>(i) * u;
    const double next = 2 * x * u - u_before;
    u_before = u;
    u = next;
  }
}

/// Points of the first kind, ascending; and the matrix from values there to coefficients of T_0 .. T_{count-1}.
inline VectorX chebyshev_points(int count) {
  VectorX x(count);
  for (int j = 0; j < count; ++j) x(j) = -std::cos(EIGEN_PI * (2 * j + 1) / (2 * count));
  return x;
}
inline MatrixX chebyshev_coefficients(int count) {
  const VectorX x = chebyshev_points(count);
  MatrixX to(count, count);
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j) to(i, j) = (i == 0 ? 1.0 : 2.0) / count * std::cos(i * std::acos(x(j)));
  return to;
}

}  // namespace palpate::fem
