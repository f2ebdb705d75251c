// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/growing_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "palpate/estimation/answer_parts.hpp"
#include "palpate/estimation/cross_check.hpp"
#include "palpate/estimation/error_budget.hpp"
#include "palpate/estimation/held_poisson.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/estimation/posterior.hpp"
#include "palpate/estimation/unknown_names.hpp"
#include "palpate/estimation/verdicts.hpp"
#include "palpate/estimation/young_bounds.hpp"

namespace palpate::estimation {
namespace {

constexpr double reuse = 0.3;   // standard deviations: equations that are moved along this far are right to some hundredths
constexpr double search_reuse = 0.2;  // the same, for the search over nu, which adds up slopes over its whole range
constexpr double anew = 1e-9;   // keep, but evaluate every step that has moved at all
constexpr double least_gain = 3;  // of the cost: less is not to be had for certain where rays change triangles
constexpr double misfit = 1.5;  // robust spread of the residuals in standard deviations: the start was far off

}  // namespace

GrowingFit::GrowingFit(FitOptions options) : options_(std::move(options)) { check(options_); }

void GrowingFit::forget_object() {
  memory_ = {};
  kept_ = {};
  same_object_ = false;
}

Identification GrowingFit::update(const Recording& recording, const SimulatedObject& object, const Inputs& inputs,
                                  const OnProgress& progress) {
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns, statics_options(recording, object, options_), memory_.model);
  memory_.model = model.solved();
  Objective objective(model, inputs, unknowns);
  const double nu_start = recording.model.poisson_fixed.value_or(options_.poisson_start);
  if (recording.model.poisson_fixed) {
    unknowns[poisson].fixed = true;
    unknowns[poisson].lower = std::min(unknowns[poisson].lower, nu_start);
    unknowns[poisson].upper = std::max(unknowns[poisson].upper, nu_start);
  }

  const std::vector<std::string> names = names_of(unknowns);
  Loss loss;
  loss.tukey = options_.tukey_cut;
  OptimiseOptions optimiser;
  optimiser.max_iterations = options_.max_iterations;
  // Solutions that are followed this far are right to some millionths; a last one on top would not be asked for, since equations
  // of steps that have not moved are kept.
  optimiser.enough_gain = 1e-4;  // a hundredth of a standard deviation
  optimiser.reuse = 0.003;
  optimiser.reuse_error = 1;
  Optimum optimum;
  bool found = false;
  // What is found here is kept when all is done: a caller that stops it by an exception finds what was there before.
  std::optional<Loss> weighed = loss_;
  if (model.load_shares() != load_shares_ && model.gives_way()) kept_ = {};  // earlier steps are smaller shares of a new highest load
  load_shares_ = model.load_shares();
  if (weighed) {
    VectorX start = unknowns.prior_mean();
    std::map<std::string, int> place;
    for (std::size_t k = 0; k < names.size(); ++k) {
      place[names[k]] = static_cast<int>(k);
      const auto value = known_.find(names[k]);
      // Another mesh has other modes of the rest surface.
      if (value != known_.end() && (same_object_ || names[k].rfind("rest_surface[", 0) != 0)) start(static_cast<Index>(k)) = value->second;
    }
    std::vector<int> moved;  // where the earlier unknowns are now
    for (const auto& name : names_) moved.push_back(place.count(name) > 0 ? place.at(name) : -1);
    objective.adopt(std::move(kept_), moved);
    kept_ = {};
    objective.set_reuse(reuse);
    // Which rays of a new step count is chosen where the steps before it say that it should be.
    if (model.superposes()) {
      weighed = objective.choose_rays(start, *weighed);
    } else if (objective.evaluate(start, *weighed, progress).usable) {
      weighed = objective.with_chosen_rays(*weighed);
    }
    optimum = optimise(objective, start, *weighed, optimiser, progress);
    if (optimum.termination == Termination::no_progress &&
        newton_step(optimum.evaluation, moving_unknowns(unknowns, optimum.unknowns, optimum.evaluation.gradient)).gain < least_gain) {
      optimum.termination = Termination::converged;
      optimum.message = "converged";
    }
    if (optimum.evaluation.usable && optimum.termination != Termination::cancelled && optimum.termination != Termination::converged) {
      objective.set_reuse(anew);
      optimum = optimise(objective, optimum.unknowns, *weighed, optimiser, progress);
      objective.set_reuse(reuse);
    }
    optimum.loss = *weighed;
    found = optimum.evaluation.usable && objective.residual_scale() < misfit * std::max(1.0, weighed->tukey / loss.tukey);
  }
  if (!found && optimum.termination != Termination::cancelled) {
    objective.set_reuse(0);
    VectorX start = unknowns.prior_mean();
    if (options_.young_start_pa) {
      start(log_young) = std::log(*options_.young_start_pa);
      start(poisson) = std::clamp(nu_start, unknowns[poisson].lower, unknowns[poisson].upper);
    } else {
      start = find_start(objective, nu_start);
    }
    optimum = optimise_from_several(objective, start, loss, optimiser, progress);
    objective.set_reuse(reuse);
    if (optimum.evaluation.usable) objective.evaluate(optimum.unknowns, optimum.loss, progress);
  }

  Identification answer;
  answer.material = object.material;
  answer.termination = optimum.termination;
  answer.message = optimum.message;
  answer.fit.pushes = recording.pushes.size();
  answer.fit.steps = model.step_count();
  answer.fit.iterations = optimum.iterations;
  const auto done = [&] {
    answer.fit.solves = model.solves();
    answer.fit.load_cases = model.load_cases();
    steps_evaluated_ = objective.steps_evaluated();
    return answer;
  };
  if (!optimum.evaluation.usable) {
    if (optimum.termination != Termination::cancelled) {
      answer.verdicts.push_back({"not_converged", "The simulation found no equilibrium (" + optimum.message +
                                                      "): check the loads, the supports and the material."});
    }
    return done();
  }

  const ResidualSummary residuals = objective.summarise(optimum.loss);
  const double factor = residuals.points > 0 ? tukey_information_factor(optimum.loss.tukey) : 1;
  const std::vector<int> moving = free_unknowns(unknowns);
  MatrixX information = optimum.evaluation.information(factor);
  bound_young(information, unknowns);
  const MatrixX hessian = information(moving, moving);
  const MatrixX covariance = hessian.ldlt().solve(MatrixX::Identity(hessian.rows(), hessian.cols()));
  answer.nuisances = nuisances_from(objective, optimum, covariance, moving);
  const FitSummary summary = summary_of(unknowns, optimum, residuals);
  answer.fit.points_used = summary.points_used;
  answer.fit.rms_m = summary.rms_m;
  answer.fit.chi2_per_dof = summary.chi2_per_dof;

  // The next update starts here, whatever the search over nu below visits.
  const auto remember = [&] {
    same_object_ = true;
    loss_ = optimum.loss;
    names_ = names;
    known_.clear();
    for (std::size_t k = 0; k < names.size(); ++k) known_[names[k]] = optimum.unknowns(static_cast<Index>(k));
  };

  objective.set_reuse(search_reuse, false);
  const Posterior posterior = explore_posterior(objective, optimum, optimum.loss, factor, progress);
  answer.budget = error_budget(unknowns, posterior.cancelled ? hessian : with_bounded_poisson(hessian, moving, posterior.poisson_std()), moving,
                               object.region_names);
  if (posterior.cancelled) {
    answer.termination = Termination::cancelled;
    answer.message = "stopped by the caller";
    remember();
    return done();
  }
  std::vector<Posterior> regions{posterior};
  for (Index r = 1; r <= unknowns.ratio_count(); ++r) regions.push_back(posterior.of_region(r));
  const OwnPoisson own = own_poisson(unknowns, optimum, covariance, moving);
  answer.parameters = parameters_from(regions, own, unknowns, object.region_names);
  answer.covariance = own.covariance_with(covariance_of(regions));
  objective.set_reuse(reuse);
  objective.evaluate(optimum.unknowns, optimum.loss);  // verdicts look at the optimum's rows
  answer.verdicts = judge({recording, objective, optimum, residuals, answer, CrossChecks{}, Doubts{}, std::nullopt});
  if (auto unexplored = nu_not_explored(posterior)) answer.verdicts.push_back(std::move(*unexplored));
  answer.provenance["posterior"] = posterior.quadrature ? "quadrature over nu" : "Laplace";
  kept_ = objective.take_kept();
  remember();
  return done();
}

}  // namespace palpate::estimation
