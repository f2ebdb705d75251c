// SPDX-License-Identifier: Apache-2.0
// A fit of a recording that is still being made: each new step moves the posterior on from where it was.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/objective.hpp"

namespace palpate::estimation {

/// Starts every update at the last one's optimum. A linear object is solved for once a contact. What an earlier step says is
/// kept as its normal equations, at the optimum and at the values of nu that the search over nu visits, and made anew only where
/// the unknowns have moved by more than a third of the standard deviation that it leaves them by itself. The mesh's error, the checks of parts against each other and the inflation by neighbours that
/// err together are left to `fit`, which is for the end.
class GrowingFit {
 public:
  /// @throws Error naming the option that is out of range
  explicit GrowingFit(FitOptions options = {});

  /// @param recording  all so far: since the last update, steps were added to its last push, or pushes
  /// @param object     that of the last update, unless forget_object() was called
  /// @param inputs     one list a step
  /// @returns parameters with intervals, covariance, nuisances, fit and the verdicts that need no check of parts; no steps
  /// @throws Error as `fit` does
  Identification update(const Recording& recording, const SimulatedObject& object, const Inputs& inputs,
                        const OnProgress& progress = {});

  /// The object is another from now on (a finer mesh): what was solved for is not used again, what was found is.
  void forget_object();

  /// Steps whose residuals the last update made anew, once for every time.
  int steps_evaluated() const { return steps_evaluated_; }
  /// What was solved for; `fit` may go on with it.
  FitMemory& memory() { return memory_; }

 private:
  FitOptions options_;
  FitMemory memory_;
  std::map<std::string, double> known_;  // unknowns at the last optimum, by name
  std::optional<Loss> loss_;             // of the last optimum
  Objective::Kept kept_;
  std::vector<std::string> names_;  // of the unknowns that kept_ counts
  std::vector<double> load_shares_;     // of the model that kept_ is of
  bool same_object_ = true;
  int steps_evaluated_ = 0;
};

}  // namespace palpate::estimation
