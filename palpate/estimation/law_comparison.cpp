// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/law_comparison.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "palpate/estimation/answer_parts.hpp"
#include "palpate/estimation/held_out.hpp"
#include "palpate/estimation/held_poisson.hpp"

namespace palpate::estimation {
namespace {

constexpr std::array laws = {"linear", "neo_hookean", "foam"};
constexpr double much = 10;         // of chi-square: what makes another law the better one, a likelihood of e^5
constexpr int stiffer_starts = 3;   // by a factor of two each: a law that softens may not bear the load at another law's E

OptimiseOptions bounded() {
  OptimiseOptions options;
  options.max_iterations = 15;
  options.step_tolerance = 0.02;
  return options;
}

/// A law's own unknowns, where the fit of another law has theirs: priors and bounds alike, by name.
VectorX start_from(const Unknowns& known, const VectorX& at, Unknowns& unknowns) {
  VectorX start = unknowns.prior_mean();
  for (int k = 0; k < unknowns.size(); ++k) {
    for (int other = 0; other < known.size(); ++other) {
      if (known[other].name != unknowns[k].name) continue;
      start(k) = at(other);
      unknowns[k].fixed = known[other].fixed;
      unknowns[k].lower = known[other].lower;
      unknowns[k].upper = known[other].upper;
    }
  }
  return start;
}

/// The highest loads of all pushes that have lower ones, at once, so that one refit serves them.
LeftOut highest_of_all(const PartialFits& fits) {
  const ForwardModel& model = fits.model();
  LeftOut all;
  StepFlags highest(model.step_count(), 0);
  for (std::size_t first = 0; first < model.step_count();) {
    StepFlags push(model.step_count(), 0);
    std::size_t end = first;
    while (end < model.step_count() && model.index(end).push == model.index(first).push) push[end++] = 1;
    for (const StepFlags& set : highest_loads(fits, {push}, 1).sets)
      for (std::size_t s = first; s < end; ++s) highest[s] = set[s];
    first = end;
  }
  all.what = "the highest load of each push";
  if (std::find(highest.begin(), highest.end(), 1) == highest.end()) return all;
  all.sets.push_back(std::move(highest));
  all.push.push_back(0);
  return all;
}

/// Half of chi-square at the nearest optimum of the unknowns that may move: nuisances are nearly linear.
double lowest_cost(const Evaluation& at, const std::vector<int>& moving) { return at.cost - newton_step(at, moving).gain; }

/// What all data cost while E and nu (and the regions' ratios) stay where `learned` has them, nuisances free, less what the data
/// cost that these were learned from: poses and tares of the held-out steps are no part of the prediction.
double surprise(Objective& objective, const Optimum& joint, const Optimum& learned) {
  const Unknowns& unknowns = objective.unknowns();
  std::vector<int> nuisances = free_unknowns(unknowns);
  std::erase_if(nuisances, [&](int k) { return k < unknowns.parameter_count(); });
  const std::vector<int> moving = moving_unknowns(unknowns, learned.unknowns, learned.evaluation.gradient);
  VectorX at = joint.unknowns;
  at.head(unknowns.parameter_count()) = learned.unknowns.head(unknowns.parameter_count());
  Evaluation all = objective.evaluate(at, joint.loss);
  if (!all.usable) return HeldOut::unknown;
  if (!nuisances.empty()) {
    const VectorX move = newton_step(all, nuisances).move;
    VectorX next = at;
    for (std::size_t k = 0; k < nuisances.size(); ++k) next(nuisances[k]) += move(static_cast<Index>(k));
    const Evaluation there = objective.evaluate(next, joint.loss);
    if (there.usable && there.cost < all.cost) all = there;
  }
  return 2 * (lowest_cost(all, nuisances) - lowest_cost(learned.evaluation, moving));
}

/// @returns false when the caller asked to stop
bool fit_law(const Recording& recording, const SimulatedObject& object, const Inputs& inputs, const FitOptions& options,
             const Unknowns& known, const Optimum& fitted, const OnProgress& progress, LawFit& out) {
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns, statics_options(recording, object, options));
  Objective objective(model, inputs, unknowns);
  VectorX start = start_from(known, fitted.unknowns, unknowns);
  Optimum optimum;
  for (int stiffer = 0; stiffer <= stiffer_starts; ++stiffer) {
    optimum = optimise(objective, start, fitted.loss, bounded(), progress);
    if (optimum.termination == Termination::cancelled) return false;
    if (optimum.evaluation.usable) break;
    start(log_young) += std::log(2.0);
    model.forget();
  }
  if (!optimum.evaluation.usable) {
    out.message = "found no equilibrium: " + optimum.message;
    return true;
  }
  optimum.loss = fitted.loss;
  const Evaluation there = objective.evaluate(optimum.unknowns, optimum.loss);
  if (!there.usable) {
    out.message = "found no equilibrium: " + there.reason;
    return true;
  }
  const ResidualSummary residuals = objective.summarise(optimum.loss);
  out.young_modulus_pa = std::exp(optimum.unknowns(log_young));
  out.poisson_ratio = optimum.unknowns(poisson);
  out.chi2 = 2 * there.cost;
  out.chi2_per_dof = summary_of(unknowns, optimum, residuals).chi2_per_dof;
  const double factor = residuals.points > 0 ? tukey_information_factor(optimum.loss.tukey) : 1;
  PartialFits fits(objective, optimum, optimum.loss, factor, progress);
  std::vector<Optimum> learned;
  out.held_out = hold_out(fits, highest_of_all(fits), {}, &learned);
  if (fits.cancelled()) return false;
  if (!out.held_out.available || learned.empty()) {
    out.message = "predicted no highest load: pushes have one level, or it found no equilibrium there";
    return true;
  }
  out.held_out_chi2 = surprise(objective, optimum, learned.front());
  out.usable = std::isfinite(out.held_out_chi2);
  if (!out.usable) out.message = "found no equilibrium under the highest loads at the E that the lower ones ask for";
  return true;
}

}  // namespace

LawComparison compare_laws(const Recording& recording, const SimulatedObject& object, const Inputs& inputs, const FitOptions& options,
                           const Unknowns& unknowns, const Optimum& optimum, const OnProgress& progress) {
  std::vector<std::string> names{object.material};
  for (const char* law : laws)
    if (law != object.material) names.emplace_back(law);
  LawComparison out;
  for (std::size_t k = 0; k < names.size() && !out.cancelled; ++k) {
    SimulatedObject other = object;
    other.material = names[k];
    LawFit& fit = out.laws.emplace_back();
    fit.law = names[k];
    const double done = static_cast<double>(k) / static_cast<double>(names.size());
    const OnProgress keep_going = [&](std::string_view, double) { return !progress || progress("other laws", done); };
    out.cancelled = !keep_going("other laws", 0) || !fit_law(recording, other, inputs, options, unknowns, optimum, keep_going, fit);
  }
  return out;
}

const LawFit* best_law(const std::vector<LawFit>& all, const std::string& fitted) {
  const LawFit *best = nullptr, *own = nullptr;
  for (const LawFit& each : all) {
    if (!each.usable) continue;
    if (each.law == fitted) own = &each;
    if (best == nullptr || each.held_out_chi2 < best->held_out_chi2) best = &each;
  }
  return own != nullptr && own->held_out_chi2 < best->held_out_chi2 + much ? own : best;
}

}  // namespace palpate::estimation
