// SPDX-License-Identifier: Apache-2.0
// The part of an object that no view showed, as something to be estimated: how far it leans away from where it was put, with a prior.
#pragma once

#include <optional>
#include <vector>

#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/estimation/solve_count.hpp"

namespace palpate::estimation {

struct UnseenSide {
  TriMesh seen;                   ///< triangles of the surface at rest that a view showed
  Vec3 toward = Vec3::UnitX();    ///< along the support, to where the object was seen from
  Vec3 up = Vec3::UnitZ();        ///< out of the support
  bool from_above = false;        ///< it was seen from no side: `toward` is any
  std::vector<Vec3> touched_m;    ///< where tools met it: the surface is known there as well
};

/// What the unseen part may do: each moves it along the support in proportion to the distance from the nearest place that was seen
/// or touched, so that these stay, and what stands on the support stays on it. Of what was seen from a side: away and aside, evenly
/// and growing with height or breadth. Of what was seen from above: everything linear in the support's plane. And of both: all around
/// towards the middle, for what stands on a small foot.
inline constexpr int unseen_mode_count = 7;

/// One standard deviation of each: metres of motion a metre of that distance. The first six together are 0.4 rms; mirrored backs of 11 bears,
/// 12 cubes, 6 animals and 6 balls were off by 0.5, 0.2, 0.6 and 0.3 of that distance, flat ones by 0.6, 0.2, 0.7 and 0.5.
inline constexpr double unseen_lean_std = 0.25;

/// Of what the modes may do to E and nu before the pushes have said anything, this share stays: most of what those completions were off
/// by is rougher than these modes, and no push tells of it.
inline constexpr double unseen_rough_share = 0.5;

/// @param amounts  of each mode, in standard deviations; halved until no element loses nine tenths of its volume, and handed back like that
TetMesh with_unseen_moved(const TetMesh& mesh, const UnseenSide& side, VectorX& amounts);

/// What the modes do to an optimum: one step of Gauss and Newton with them among the unknowns.
struct UnseenModes {
  VectorX change;      ///< of all unknowns of the objective; Poisson ratios stay in their range
  VectorX amounts;     ///< of the modes at the end of that step, in standard deviations
  MatrixX widening;    ///< what the unseen side adds to the covariance of the parameters (log E of the first region, nu, ratios)
  double gain = 0;     ///< by which the cost falls on that step
};

/// Changes of the surface are those of small strains at the optimum's nu. The objective's last evaluation must be the optimum's,
/// every step's.
/// @param amounts  of the modes, that `object` was moved by: their prior is about zero
/// @param factor   as in Evaluation::information
/// @param solved   if given: what was solved for is added
/// @returns nothing where a moved body cannot be solved for
std::optional<UnseenModes> unseen_modes(const UnseenSide& side, const VectorX& amounts, const Recording& recording, const SimulatedObject& object,
                                        const Objective& objective, const Optimum& optimum, const Loss& loss, double factor,
                                        const FitOptions& options, SolveCount* solved = nullptr);

}  // namespace palpate::estimation
