// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/objective.hpp"

namespace palpate::estimation {

struct Optimum;

struct OptimiseOptions {
  int max_iterations = 60;
  double step_tolerance = 1e-3;  ///< stop when log E and nu move by less than this share of their standard deviation
  double enough_gain = 0;         ///< stop where a Newton step would lower the cost by less than this
  /// Called where a round starts and after every accepted step; the objective's last evaluation is this one's.
  std::function<void(const Optimum&, bool starts)> on_accepted;
  /// Non-linear steps follow their derivatives this far (ForwardModel::set_reuse), the optimum itself no further than
  /// ForwardModel::reuse_error.
  double reuse = 0.02, reuse_error = 1e-6;
};

struct Optimum {
  VectorX unknowns;
  Evaluation evaluation;
  Termination termination = Termination::failed;
  std::string message;
  int iterations = 0;
  bool poisson_at_lower = false, poisson_at_upper = false;
  Loss loss;  ///< that it is the optimum of
};

/// Levenberg-Marquardt in log E, nu (kept inside its bounds by an active set) and all nuisances that are not fixed.
Optimum optimise(Objective& objective, const VectorX& start, const Loss& loss, const OptimiseOptions& options,
                 const OnProgress& progress);

/// Whole way from a start: closest points with a wide robust loss first, then tightened to `final_loss`.
Optimum optimise_annealed(Objective& objective, const VectorX& start, const Loss& final_loss, const OptimiseOptions& options,
                          const OnProgress& progress);

/// The same; where the result does not fit although sigma is known, from starts a factor of four softer and stiffer as well
/// (poses and E trade against each other when the shape is far off). The best one counts.
Optimum optimise_from_several(Objective& objective, const VectorX& start, const Loss& final_loss, const OptimiseOptions& options,
                              const OnProgress& progress);

/// Change of every free unknown but those held that leads to the optimum of the evaluation's quadratic, and what it gains.
struct NewtonStep {
  VectorX move;
  double gain = 0;
};
NewtonStep newton_step(const Evaluation& evaluation, const std::vector<int>& moving);

/// `loss` with its cut widened by the robust spread of the last evaluation's residuals where that exceeds the sensors' sigma.
/// The spread only says what counts as an outlier; weights and intervals keep the sensors' sigma.
Loss fitting_loss(const Objective& objective, const Loss& loss);

/// A start for log E from solutions at one guess: displacements of an elastic body scale with 1/E, reactions with E. Every
/// other unknown starts at its prior mean. Nothing but the data decides: a grid over fourteen decades is searched.
VectorX find_start(Objective& objective, double poisson_start);

/// Indices of unknowns that may move.
std::vector<int> free_unknowns(const Unknowns& unknowns);

}  // namespace palpate::estimation
