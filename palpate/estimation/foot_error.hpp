// SPDX-License-Identifier: Apache-2.0
// What the strip above a support that no sensor tells from the support does to the answer: the foot is where the flanks that were
// seen are thought to meet the plane.
#pragma once

#include <optional>
#include <vector>

#include "palpate/estimation/answer_shift.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/optimise.hpp"

namespace palpate::estimation {

struct FootDoubt {
  Plane plane;         ///< that the object stands on, its normal out of it
  double strip_m = 0;  ///< height below which flanks were not seen, but go on from above
  std::optional<std::vector<AnswerShift>> effect;  ///< filled by the first fit; later ones, on finer meshes, take it as it is
};

/// Of flanks that were followed down to a table, one standard deviation: what all of them lean in common by, and half of it towards
/// one side. Feet of balls are off by 0.04 to 0.08 and by 0.06, those of bears and of thin legs by more (docs/estimator.md).
inline constexpr double foot_lean_std_rad = 0.1, foot_aside_std_rad = 0.05;

/// A mesh whose nodes below the strip's upper end moved along the plane: outwards from the middle of the foot that is nearest by
/// `lean_rad` at the distance of the foot's radius (of a disc of its area), and along `aside`, both times the depth in the strip.
TetMesh with_foot_moved(const TetMesh& mesh, const TriMesh& surface, const FootDoubt& doubt, double lean_rad, const Vec3& aside);

/// Where the answer would go if flanks leant by one standard deviation more, and if they all leant towards one side, either way
/// along the plane: independent errors of one standard deviation each. Small strains and one step of Gauss and Newton, as for a
/// mesh's error. The objective's last evaluation must be the optimum's.
/// @returns nothing where no foot is found, or the caller asked to stop
std::optional<std::vector<AnswerShift>> foot_effect(const FootDoubt& doubt, const Recording& recording, const SimulatedObject& object,
                                                    const Objective& objective, const Optimum& optimum, const Loss& loss,
                                                    const FitOptions& options, const OnProgress& progress);

}  // namespace palpate::estimation
