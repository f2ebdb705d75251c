// SPDX-License-Identifier: Apache-2.0
// A Poisson ratio, the shared one or a region's own, that lies on a bound of its range and is pushed out does not move: a step that
// takes it for free takes it out, and all else with it along the ridge.
#pragma once

#include <vector>

#include "palpate/estimation/optimise.hpp"

namespace palpate::estimation {

/// nu, or a region's own.
bool is_poisson(const Unknowns& unknowns, int k);

/// Such a one on a bound that the gradient of the cost pushes it out of.
bool is_held(const Unknowns& unknowns, const VectorX& at, const VectorX& gradient, int k);

/// Indices of the unknowns that move from here: all that are free but those held.
std::vector<int> moving_unknowns(const Unknowns& unknowns, const VectorX& at, const VectorX& gradient);

/// Whether this move of the unknowns `moving` takes a Poisson ratio out of its range. @param at  of `unknowns`; `moving` may have more
bool leaves_range(const Unknowns& unknowns, const VectorX& at, const std::vector<int>& moving, const VectorX& move);

/// The step to where this quadratic is least while every Poisson ratio is in its range: what would leave it stops at its bound, and all
/// else is solved for anew. The same as newton_step where none would.
/// @param curvature, gradient  over all that `moving` has an index of
NewtonStep step_in_range(const Unknowns& unknowns, const VectorX& at, const MatrixX& curvature, const VectorX& gradient,
                         const std::vector<int>& moving);

/// Says of an optimum whether its nu is held, and where.
void note_held(const Unknowns& unknowns, Optimum& optimum);

}  // namespace palpate::estimation
