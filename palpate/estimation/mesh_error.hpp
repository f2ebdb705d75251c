// SPDX-License-Identifier: Apache-2.0
// What the simulated mesh itself does to the answer: where the fit would end on a mesh twice as fine under the tools.
#pragma once

#include <optional>

#include "palpate/estimation/answer_shift.hpp"
#include "palpate/estimation/finer_model.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/estimation/posterior.hpp"

namespace palpate::estimation {

/// What the change of the simulated surfaces and travels between the two meshes does to the optimum: one step of Gauss and
/// Newton. Small strains are used for the change, one factorisation each. Where the error falls with the power p of the edge
/// length, the coarse mesh is off by the change over 1 - r^p, r the ratio of the edges (FinerModel::left). What `finer` knows
/// of elsewhere is added. The objective's last evaluation must be the optimum's.
/// @param object  on the mesh that its answers are those of, with the recording that names its nodes
/// @param solved  nullptr: the finer mesh is solved for at the optimum's nu. Else what is used and filled: a linear object is
///                then solved for over all of nu's range, once for all fits that share it
/// @returns nothing when the caller asked to stop.
std::optional<AnswerShift> mesh_shift(const Recording& recording, const SimulatedObject& object, const Objective& objective,
                                      const Optimum& optimum, const Loss& loss, const FinerModel& finer, const FitOptions& options,
                                      const OnProgress& progress,
                                      std::shared_ptr<ForwardModel::Solved>* solved = nullptr);

/// Moves a posterior to where it would be without an error that is known: what the data say of nu, with its ridge log E(nu), and is cut at
/// nu's bounds there. Where it is pressed against a bound, that leaves nu about where it was.
void move(Posterior& posterior, const AnswerShift& shift, double poisson_lower, double poisson_upper);

/// Adds an error of known direction and normally distributed size (one standard deviation: `shift`) to a posterior. Exact for
/// normal posteriors; bounds of nu are kept.
void widen(Posterior& posterior, const AnswerShift& shift, double poisson_lower, double poisson_upper);

}  // namespace palpate::estimation
