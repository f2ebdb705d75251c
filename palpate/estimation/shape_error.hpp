// SPDX-License-Identifier: Apache-2.0
// What a part of the object that nobody saw does to the answer: where the fit ends when other shapes stand there.
#pragma once

#include <optional>
#include <vector>

#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/foot_error.hpp"
#include "palpate/estimation/mesh_error.hpp"
#include "palpate/estimation/optimise.hpp"

namespace palpate::estimation {

/// The same object with another unseen side; the seen one is the same within the sensors' noise.
struct AlternativeShape {
  Recording recording;  ///< as the fit uses it: volume, surface, supports
  SimulatedObject object;
  bool as_likely = false;  ///< beforehand, as the one that is fitted: the pushes choose between them
};

struct ShapeEffect {
  AnswerShift shift;                       ///< one standard deviation
  double softest_pa = 0, stiffest_pa = 0;  ///< E over all shapes that the pushes do not rule out
  std::optional<std::size_t> better;       ///< alternative that agrees better with the pushes; `shift` is about it
};

/// Of an object that was seen from one side: `shapes`. Of one that was seen from all around: `foot`.
struct ShapeDoubt {
  std::vector<AlternativeShape> shapes;  ///< the farthest is about one and a half standard deviations from the one that is fitted
  double unseen_share = 0;               ///< of the object's surface, its foot left out
  std::optional<ShapeEffect> effect;     ///< filled by the first fit; later ones, on finer meshes, take it as it is
  std::optional<FootDoubt> foot;
};

/// Fits all shapes to the same few of the points, from the optimum on. An alternative that is as likely and fits better takes the place of the one
/// that was fitted. A shape that wants force or travel of a push to be off by more than three of their standard deviations is ruled out, unless
/// that one wants it too. Two thirds of what moves log E most among the others is one standard deviation of an error along that direction; nu moves
/// with it. Alternatives whose fit does not end are left out.
/// @returns nothing where none ended, or the caller asked to stop.
std::optional<ShapeEffect> shape_effect(const ShapeDoubt& doubt, const Recording& recording, const Inputs& inputs,
                                        const Objective& objective, const Optimum& optimum, const Loss& loss, const FitOptions& options,
                                        const OptimiseOptions& optimiser, const OnProgress& progress);

}  // namespace palpate::estimation
