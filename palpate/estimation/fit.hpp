// SPDX-License-Identifier: Apache-2.0
// The fit of a whole recording: all steps of all pushes at once, maximum a posteriori, with intervals, nuisances and verdicts.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/estimation/answer_shift.hpp"
#include "palpate/estimation/objective.hpp"

namespace palpate::estimation {

/// Called by the fit's own thread after every accepted iteration with what is known so far: E and nu (their intervals NaN
/// until there is a posterior), the trace, and the steps' surfaces and points at this estimate.
using OnEstimate = std::function<void(const Identification& so_far)>;

struct FinerModel;

/// A mesh to go on with, and one that shows what it does to the answer in turn; both outlive the fit.
struct FinerMesh {
  const FinerModel* mesh = nullptr;
  const FinerModel* finer = nullptr;  ///< nullptr: there is none
};

/// What a fit knows of its mesh once it has found its optimum.
struct MeshDoubt {
  AnswerShift shift;              ///< that it causes, as the finer one shows it
  std::vector<double> young_std;  ///< what all else leaves unknown of E, as a share of it: a region each
  /// The same as another mesh shows it, of the one that was fitted with; nothing when the caller asked to stop.
  std::function<std::optional<AnswerShift>(const FinerModel&)> shown_by;
};

struct FitOptions {
  int max_iterations = 60;
  double tukey_cut = 4.685;               ///< standard deviations beyond which a point is an outlier
  std::optional<double> young_start_pa;   ///< nothing: found from the data
  double poisson_start = 0.3;             ///< moved into the prior's range
  bool start_is_answer = false;           ///< of a coarser mesh, say: a misfit is then no reason to look elsewhere
  bool cross_checks = true;               ///< refit parts of the recording: per push, by load, held-out prediction
  bool find_slips = false;                ///< slips of a tool (slips.hpp) also without cross-checks, where travel or an uncertain
                                          ///< contact asks for one
  bool compare_laws = false;              ///< other laws are fitted too, also where E does not drift with the load (law_comparison.hpp)
  bool stresses = true;                   ///< von Mises stress of every step, for figures
  int threads = 1;                        ///< 0: as many as the machine has. Steps that start from their neighbours' solutions are shared out
                                          ///< among them, so the last digits may depend on their number
  OnEstimate on_estimate;                 ///< for those who watch; empty: nobody does
  /// Asked once it is known what the mesh does to E and what all else leaves unknown of it (a region each): a mesh that is
  /// fine enough, or nullptr. The fit goes on with it where it can (MeshCorrection); else it ends at its optimum, without
  /// intervals (no covariance), and the caller fits again on that mesh.
  std::function<const FinerMesh*(const MeshDoubt&)> take_finer;
};

struct ShapeDoubt;

/// What a fit leaves for the next one of the same object, held and touched in the same way: what was solved for and does not
/// depend on what was measured.
struct FitMemory {
  std::shared_ptr<ForwardModel::Solved> model, finer, doubted;
};

/// @throws Error naming the option that is out of range.
void check(const FitOptions& options);

/// What the sensors of one step contribute, in the recording's order of pushes and steps.
using Inputs = std::vector<std::vector<TermInput>>;

/// How the solver is set up for a recording: threads, and the cure for locking where nu may come near 0.5.
fem::StaticsOptions statics_options(const Recording& recording, const SimulatedObject& object, const FitOptions& options);
/// The same where nu is known to stay below `largest_poisson`.
fem::StaticsOptions statics_options(const SimulatedObject& object, const FitOptions& options, double largest_poisson);

/// @param recording  loads, supports, priors; recording.model gives nu's prior range and whether it is fixed
/// @param inputs     one list a step
/// @param finer      the same object on a finer mesh, nullptr where the mesh is to be taken as it is: what the mesh does to the
///                   answer then widens the intervals (mesh_error.hpp)
/// @param memory     used and filled; nullptr: nothing is kept
/// @param doubt      other shapes that the object may have where nobody saw it, nullptr where there is no such part: what they
///                   do to the answer then widens the intervals too (shape_error.hpp). Where one agrees better with the pushes
///                   (`doubt->effect->better`) the answer ends at that finding, without intervals: fit that one
/// @throws Error when no answer can exist (no observation, supports that hold nothing, ...). Numbers that did not work out
///         are said in `termination`, `message` and `verdicts`.
Identification fit(const Recording& recording, const SimulatedObject& object, const Inputs& inputs, const FitOptions& options,
                   const OnProgress& progress = {}, const FinerModel* finer = nullptr,
                   FitMemory* memory = nullptr, ShapeDoubt* doubt = nullptr);

}  // namespace palpate::estimation
