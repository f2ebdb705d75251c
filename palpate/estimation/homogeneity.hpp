// SPDX-License-Identifier: Apache-2.0
// Do several estimates of one E agree?
#pragma once

#include "palpate/core/math.hpp"

namespace palpate::estimation {

/// Of log E between contacts: patch and pressure are idealised.
inline constexpr double contact_model_std = 0.02;

/// Cochran's Q test that parts share one E: chance of differences at least as large (Cochran 1954; here of estimates that err
/// together). 2 % for the tool's contact, which no part knows, come on top of each.
/// @param log_moduli  of the parts, (n)
/// @param covariance  of these, (n x n)
/// @returns 1 for fewer than two parts
double homogeneity_p_value(const VectorX& log_moduli, MatrixX covariance);

/// Upper tail of the chi-square distribution.
double chi_square_tail(double value, int degrees_of_freedom);

}  // namespace palpate::estimation
