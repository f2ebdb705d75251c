// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/partial_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "palpate/estimation/held_poisson.hpp"
#include "palpate/estimation/homogeneity.hpp"

namespace palpate::estimation {
namespace {

constexpr double near_log = 0.1;  // of log E: one step from the joint optimum gets a part's own to a few per mille

OptimiseOptions few_iterations() {
  OptimiseOptions options;
  options.max_iterations = 10;
  options.step_tolerance = 0.02;
  return options;
}

}  // namespace

Parameter parameter_of(const PartialYoung& young) {
  constexpr double z_95 = 1.959963984540054;
  Parameter out{"young_modulus", young.name, "Pa"};
  out.value = std::exp(young.log_young);
  out.std = out.value * young.std;
  out.lower_95 = std::exp(young.log_young - z_95 * young.std);
  out.upper_95 = std::exp(young.log_young + z_95 * young.std);
  return out;
}

PartialFits::PartialFits(Objective& objective, const Optimum& optimum, const Loss& loss, double factor, const OnProgress& progress)
    : objective_(objective), optimum_(optimum), loss_(loss), factor_(factor), progress_(progress),
      joint_rows_(objective.last_rows()), joint_predictions_(objective.last_predictions()) {}

/// One step of Gauss and Newton from the joint optimum needs no solution; where it leads far, the part is fitted for good.
Optimum PartialFits::refit(const StepFlags& steps, bool hold_poisson) {
  Loss loss = loss_;
  loss.steps = steps;
  const Unknowns& unknowns = objective_.unknowns();
  const bool was_fixed = unknowns[poisson].fixed;
  objective_.hold_poisson(hold_poisson || was_fixed);
  Optimum part;
  part.unknowns = optimum_.unknowns;
  part.evaluation = objective_.assemble(joint_rows_, optimum_.unknowns, loss);
  const std::vector<int> moving = moving_unknowns(unknowns, optimum_.unknowns, part.evaluation.gradient);
  const VectorX move = newton_step(part.evaluation, moving).move;
  const bool leaves = leaves_range(unknowns, optimum_.unknowns, moving, move);
  for (std::size_t k = 0; k < moving.size(); ++k) part.unknowns(moving[k]) += move(static_cast<Index>(k));
  note_held(unknowns, part);
  part.termination = Termination::converged;
  if (!move.allFinite() || std::abs(move(0)) > near_log || leaves) {
    const OnProgress keep_going = [&](std::string_view, double share) { return !progress_ || progress_("cross-check", share); };
    part = optimise(objective_, optimum_.unknowns, loss, few_iterations(), keep_going);
  }
  objective_.hold_poisson(was_fixed);
  cancelled_ = cancelled_ || part.termination == Termination::cancelled;
  return part;
}

PartialYoung PartialFits::young_of(const StepFlags& steps, const std::string& name) {
  PartialYoung out;
  out.name = name;
  out.steps = steps;
  const Optimum part = refit(steps, true);
  if (cancelled_ || !part.evaluation.usable || part.termination == Termination::failed) return out;
  const MatrixX information = part.evaluation.information(factor_);
  std::vector<int> others;
  for (int k : free_unknowns(objective_.unknowns())) {
    if (k != poisson) others.push_back(k);
  }
  const Eigen::LDLT<MatrixX> factorised(information(others, others));
  out.gain = VectorX::Zero(information.rows());
  const VectorX gain = factorised.solve(VectorX::Unit(static_cast<Index>(others.size()), 0));
  out.gain(others) = gain;
  const double variance = out.gain(log_young);
  out.log_young = part.unknowns(log_young);
  out.std = std::sqrt(std::max(variance, 0.0));
  out.slope = -factorised.solve(VectorX(information.col(poisson)(others)))(0);
  // A part that says nothing about E leaves it where it was: no evidence either way.
  out.usable = std::isfinite(variance) && variance > 0 && out.std < 0.5;
  return out;
}

double PartialFits::chance_of_one_young(const std::vector<PartialYoung>& all, double poisson_std) {
  std::vector<const PartialYoung*> parts;
  for (const PartialYoung& part : all)
    if (part.usable) parts.push_back(&part);
  const Index count = static_cast<Index>(parts.size());
  if (count < 2) return 1;
  const auto known_of = [&](StepFlags steps) {  // priors included
    Loss loss = loss_;
    loss.steps = std::move(steps);
    return objective_.assemble(joint_rows_, optimum_.unknowns, loss).information(factor_);
  };
  const MatrixX priors = known_of(StepFlags(joint_rows_.size(), 0));
  VectorX young(count);
  MatrixX covariance(count, count);
  for (Index p = 0; p < count; ++p) {
    const PartialYoung& one = *parts[static_cast<std::size_t>(p)];
    young(p) = one.log_young;
    covariance(p, p) = one.std * one.std + std::pow(one.slope * poisson_std, 2);
    for (Index q = 0; q < p; ++q) {
      const PartialYoung& other = *parts[static_cast<std::size_t>(q)];
      StepFlags common(one.steps.size());
      for (std::size_t s = 0; s < common.size(); ++s) common[s] = one.steps[s] != 0 && other.steps[s] != 0;
      const bool any = std::find(common.begin(), common.end(), 1) != common.end();
      const VectorX shared = any ? VectorX(known_of(std::move(common)) * other.gain) : VectorX(priors * other.gain);
      covariance(p, q) = covariance(q, p) = one.gain.dot(shared) + one.slope * other.slope * poisson_std * poisson_std;
    }
  }
  return homogeneity_p_value(young, covariance);
}

}  // namespace palpate::estimation
