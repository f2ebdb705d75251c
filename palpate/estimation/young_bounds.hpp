// SPDX-License-Identifier: Apache-2.0
// What is known of log E where the data say nothing of it: that it lies between the bounds of the search.
#pragma once

#include <Eigen/Cholesky>

#include "palpate/estimation/unknowns.hpp"

namespace palpate::estimation {

/// Middle and standard deviation of a uniform distribution between an unknown's bounds.
double middle_of_bounds(const Unknown& unknown);
double std_of_bounds(const Unknown& unknown);

/// False where `information` says nothing of log E, its first unknown, but by rounding: its standard deviation is that of the bounds a
/// hundred times and more.
bool tells_young(const MatrixX& information, const Eigen::LDLT<MatrixX>& factorised, const Unknowns& unknowns);

/// Information that log E's bounds hold, as a normal distribution that is as wide.
double information_of_bounds(const Unknowns& unknowns);

/// Adds that where nothing else tells log E, so that the matrix can be inverted. nu, which has bounds of its own, is held meanwhile.
/// @param information  of all unknowns, an Evaluation's information or curvature
void bound_young(MatrixX& information, const Unknowns& unknowns);

}  // namespace palpate::estimation
