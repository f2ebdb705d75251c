// SPDX-License-Identifier: Apache-2.0
// A non-linear fit on a fine mesh at the price of a coarse one.
#pragma once

#include "palpate/estimation/finer_model.hpp"
#include "palpate/estimation/fit.hpp"

namespace palpate::estimation {

/// Solves the object on a finer mesh where a fit ended, and has the fit's own model corrected by what that changes, value
/// and derivatives (deferred correction, Stetter 1978: The defect correction principle). The fit goes on from there and is
/// one on the finer mesh but for the product of the mesh's error and the square of how far it still moves.
class MeshCorrection {
 public:
  /// True where it saves anything and can be had: a linear body is solved for once anyway, and what touches and lets go is
  /// not smooth enough.
  static bool applies_to(const ForwardModel& model);

  /// @param mesh           must outlive this object
  /// @param poisson_ratio  about where it is corrected: far from 0.5 plain elements do on large meshes
  MeshCorrection(const FinerModel& mesh, const Inputs& inputs, const FitOptions& options, double poisson_ratio);

  /// Has the objective's model corrected by what this mesh changes at `unknowns`; earlier corrections are gone.
  /// @returns false, and leaves the model as it was, where the finer mesh has no equilibrium there or the caller asked to stop
  bool correct(Objective& objective, const VectorX& unknowns, const Loss& loss, const OnProgress& progress);

  ForwardModel& model() { return model_; }

 private:
  Unknowns unknowns_;
  ForwardModel model_;
  Objective objective_;
};

}  // namespace palpate::estimation
