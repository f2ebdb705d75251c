// SPDX-License-Identifier: Apache-2.0
// Fits of some steps of a recording alone, from the joint optimum.
#pragma once

#include <string>
#include <vector>

#include "palpate/estimation/optimise.hpp"

namespace palpate::estimation {

/// Steps that count, one flag each.
using StepFlags = std::vector<char>;

/// log E of some steps alone, everything else but nu free under its prior.
struct PartialYoung {
  std::string name;
  StepFlags steps;
  double log_young = 0, std = 0;  ///< std: nu known
  double slope = 0;               ///< d log E / d nu
  VectorX gain;                   ///< d log E / d what the data say of each unknown: log E's covariance with all of them
  bool usable = false;
  bool cancelled = false;
};

/// As answers list it: the part's name is the region.
Parameter parameter_of(const PartialYoung& young);

class PartialFits {
 public:
  /// The objective's last evaluation must be the optimum's. All arguments must outlive this object.
  /// @param factor  information factor of robust rows
  PartialFits(Objective& objective, const Optimum& optimum, const Loss& loss, double factor, const OnProgress& progress);

  /// Where the fit of some steps alone ends.
  Optimum refit(const StepFlags& steps, bool hold_poisson);
  PartialYoung young_of(const StepFlags& steps, const std::string& name);
  /// Chance that parts which have one E differ at least as much as these do. What they share errs in all of them together: priors
  /// (of the scale of a force, a density), unloaded steps, and nu, which is known to `poisson_std`.
  double chance_of_one_young(const std::vector<PartialYoung>& parts, double poisson_std);
  bool cancelled() const { return cancelled_; }

  Objective& objective() { return objective_; }
  ForwardModel& model() { return objective_.model(); }
  const ForwardModel& model() const { return objective_.model(); }
  const Optimum& optimum() const { return optimum_; }
  const Loss& loss() const { return loss_; }
  const std::vector<TermRows>& joint_rows(std::size_t s) const { return joint_rows_[s]; }
  const StepPrediction& joint_prediction(std::size_t s) const { return joint_predictions_[s]; }

 private:
  Objective& objective_;
  const Optimum& optimum_;
  const Loss& loss_;
  double factor_;
  const OnProgress& progress_;
  std::vector<std::vector<TermRows>> joint_rows_;
  std::vector<StepPrediction> joint_predictions_;
  bool cancelled_ = false;
};

}  // namespace palpate::estimation
