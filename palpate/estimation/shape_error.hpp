// SPDX-License-Identifier: Apache-2.0
// What a part of the object that nobody saw does to the answer: where the fit ends when other shapes stand there.
#pragma once

#include <optional>
#include <vector>

#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/foot_error.hpp"
#include "palpate/estimation/mesh_error.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/estimation/unseen_modes.hpp"

namespace palpate::estimation {

/// The same object with another unseen side; the seen one is the same within the sensors' noise.
struct AlternativeShape {
  Recording recording;  ///< as the fit uses it: volume, surface, supports
  SimulatedObject object;
  bool as_likely = false;  ///< beforehand, as the one that is fitted: the pushes choose between them
  double likelihood = 0.3;  ///< beforehand, over that of the one that is fitted
  std::optional<UnseenSide> side = {};  ///< what of it may lean away; nothing: it is as it is
  std::vector<char> seen = {};          ///< a vertex of its surface: 1 where a view showed it; empty: all
  std::optional<Plane> plane = {};      ///< that hides what stands on it
};

struct ShapeEffect {
  AnswerShift move;                  ///< from the shape that agrees best to the mean over all, each leaning as the pushes have it
  std::vector<AnswerShift> shifts;   ///< what is not known of that: one standard deviation each, independent
  double softest_pa = 0, stiffest_pa = 0;  ///< E over all shapes that the pushes do not rule out
  std::optional<std::size_t> better;       ///< alternative that agrees better with the pushes; `move` is from that one
};

/// Of an object that was seen from one side: `shapes`. Of one that was seen from all around: `foot`.
struct ShapeDoubt {
  std::vector<AlternativeShape> shapes;
  double unseen_share = 0;               ///< of the object's surface, its foot left out
  std::optional<UnseenSide> side = {};   ///< of the one that is fitted
  std::optional<ShapeEffect> effect;     ///< filled by the first fit; later ones, on finer meshes, take it as it is
  std::optional<FootDoubt> foot;
};

/// Fits all shapes to the same few of the points, which all of them say were seen before, from the optimum on, and lets each lean as the pushes have it (unseen_modes.hpp). An
/// alternative that is as likely and fits clearly better takes the place of the one that was fitted. A shape that wants force or travel of a
/// push to be off by more than three of their standard deviations is ruled out, unless the best one wants it too; so is one with a tenth more
/// of chi-square. The answer is the mean over the others, its covariance theirs and what is between them. Alternatives whose fit does not end
/// are left out.
/// @param solved  if given: what was solved for is added
/// @returns nothing where none ended, or the caller asked to stop.
std::optional<ShapeEffect> shape_effect(const ShapeDoubt& doubt, const Recording& recording, const Inputs& inputs,
                                        const Objective& objective, const Optimum& optimum, const Loss& loss, const FitOptions& options,
                                        const OptimiseOptions& optimiser, const OnProgress& progress,
                                        SolveCount* solved = nullptr);

}  // namespace palpate::estimation
