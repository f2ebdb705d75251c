// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/fit.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <list>
#include <map>

#include "palpate/core/error.hpp"
#include "palpate/core/thread_count.hpp"
#include "palpate/estimation/answer_parts.hpp"
#include "palpate/estimation/contacts_found.hpp"
#include "palpate/estimation/cross_check.hpp"
#include "palpate/estimation/doubts.hpp"
#include "palpate/estimation/error_budget.hpp"
#include "palpate/estimation/held_poisson.hpp"
#include "palpate/estimation/law_comparison.hpp"
#include "palpate/estimation/load_drift.hpp"
#include "palpate/estimation/mesh_correction.hpp"
#include "palpate/estimation/mesh_error.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/estimation/own_poisson.hpp"
#include "palpate/estimation/posterior.hpp"
#include "palpate/estimation/shape_error.hpp"
#include "palpate/estimation/slips.hpp"
#include "palpate/estimation/solve_count.hpp"
#include "palpate/estimation/step_fits.hpp"
#include "palpate/estimation/verdicts.hpp"
#include "palpate/estimation/young_bounds.hpp"

namespace palpate::estimation {
namespace {

/// E of each push (or site) alone, nu held at the joint optimum.
std::vector<Parameter> young_of_parts(const std::vector<PartialYoung>& parts) {
  std::vector<Parameter> out;
  for (const auto& part : parts) {
    if (part.usable) out.push_back(parameter_of(part));
  }
  return out;
}

/// Of log E of every region.
/// @param covariance  of the unknowns `moving`, log E first
std::vector<double> young_stds(const Unknowns& unknowns, const MatrixX& covariance, const std::vector<int>& moving) {
  const MatrixX young = log_young_of_regions(unknowns, moving);
  std::vector<double> out;
  for (Index r = 0; r < young.rows(); ++r) out.push_back(std::sqrt(young.row(r).dot(covariance * young.row(r).transpose())));
  return out;
}

/// E and nu where the search stands: no interval yet.
std::vector<Parameter> parameters_so_far(const VectorX& unknowns) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  return {{"young_modulus", "", "Pa", std::exp(unknowns(log_young)), nan, nan, nan, true},
          {"poisson_ratio", "", "1", unknowns(poisson), nan, nan, nan, true}};
}

/// How many evaluations a fit takes is not known beforehand: the share done comes nearer to one with each of them.
OnProgress paced(const OnProgress& progress) {
  constexpr double typical_evaluations = 30;
  if (!progress) return {};
  return [progress, done = 0.0, last = 0.0](std::string_view stage, double share) mutable {
    if (stage != "fit") return progress(stage, share);
    if (share <= last) ++done;
    last = share;
    return progress(stage, 1 - std::exp(-(done + share) / typical_evaluations));
  };
}

}  // namespace

void check(const FitOptions& options) {
  const auto demand = [](bool fine, const char* field, const char* cure) {
    if (!fine) throw Error(cure, std::string("FitOptions.") + field);
  };
  demand(options.max_iterations >= 1, "max_iterations", "must be at least 1");
  demand(options.tukey_cut > 1.5 && std::isfinite(options.tukey_cut), "tukey_cut", "must be a number above 1.5");
  demand(!options.young_start_pa || (*options.young_start_pa > 0 && std::isfinite(*options.young_start_pa)),
         "young_start_pa", "must be positive, in pascal");
  demand(options.poisson_start > -1 && options.poisson_start < 0.5, "poisson_start", "must lie between -1 and 0.5");
  demand(options.threads >= 0, "threads", "must be at least 1, or 0: as many as the machine has");
}

fem::StaticsOptions statics_options(const Recording& recording, const SimulatedObject& object, const FitOptions& options) {
  return statics_options(object, options, recording.model.poisson_fixed.value_or(recording.model.poisson_upper));
}

fem::StaticsOptions statics_options(const SimulatedObject& object, const FitOptions& options, double largest_poisson) {
  fem::StaticsOptions statics;
  statics.threads = thread_count(options.threads);
  // A search that comes to a modulus which hardly bears the load does better to turn back than to follow it to the end.
  statics.max_load_steps = 16;
  // Quadratic tetrahedra lock mildly towards nu = 0.5 (a few per cent of E at 0.49); linear ones are left as they are, since
  // who asks for them has a reason.
  if (object.mesh.tetrahedra.cols() == 10 && largest_poisson > 0.45) statics.dilatation = fem::Dilatation::averaged;
  return statics;
}

namespace {

/// What a fit knows that starts anew, with contacts where the last one found them.
struct Looks {
  int left = 2;  // the second time to be sure
  std::optional<std::pair<double, double>> poisson_expected;
};

/// Where nu will be looked for once an optimum is known: far beyond what its own curvature says.
std::pair<double, double> around(const Optimum& optimum, const Unknowns& unknowns) {
  constexpr double far = 10, at_least = 0.03;
  const std::vector<int> moving = free_unknowns(unknowns);
  const auto place = std::find(moving.begin(), moving.end(), static_cast<int>(poisson));
  double reach = at_least;
  if (place != moving.end()) {
    const Index nu = place - moving.begin();
    const MatrixX information = optimum.evaluation.hessian(moving, moving);
    const double variance = information.ldlt().solve(VectorX::Unit(information.rows(), nu))(nu);
    reach = std::isfinite(variance) && variance > 0 ? std::max(at_least, far * std::sqrt(variance)) : 1;
  }
  return {optimum.unknowns(poisson) - reach, optimum.unknowns(poisson) + reach};
}

Identification fit_around(const Recording& recording, const SimulatedObject& object, const Inputs& inputs,
                          const FitOptions& options, const OnProgress& on_progress, const FinerModel* finer, FitMemory* memory,
                          ShapeDoubt* doubt, Looks looks) {
  const OnProgress progress = paced(on_progress);
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns, statics_options(recording, object, options),
                     memory != nullptr ? memory->model : nullptr, small_response_error, looks.poisson_expected);
  if (memory != nullptr) memory->model = model.solved();
  Objective objective(model, inputs, unknowns);
  if (recording.model.poisson_fixed) unknowns[poisson].fixed = true;

  const double nu_start = recording.model.poisson_fixed.value_or(options.poisson_start);
  VectorX start = unknowns.prior_mean();
  if (recording.model.poisson_fixed) {
    unknowns[poisson].lower = std::min(unknowns[poisson].lower, nu_start);
    unknowns[poisson].upper = std::max(unknowns[poisson].upper, nu_start);
  }
  if (options.young_start_pa) {
    start(log_young) = std::log(*options.young_start_pa);
    start(poisson) = std::clamp(nu_start, unknowns[poisson].lower, unknowns[poisson].upper);
  } else {
    start = find_start(objective, nu_start);
  }

  Identification answer;
  answer.material = object.material;
  answer.surface = object.surface.rest();
  answer.fit.pushes = recording.pushes.size();
  answer.fit.steps = model.step_count();

  Loss loss;
  loss.tukey = options.tukey_cut;
  OptimiseOptions optimiser;
  optimiser.max_iterations = options.max_iterations;
  int round = 0;
  optimiser.on_accepted = [&](const Optimum& at, bool starts) {
    if (starts) ++round;
    answer.trace.push_back({std::exp(at.unknowns(log_young)), at.unknowns(poisson), at.evaluation.cost, round});
    if (!options.on_estimate) return;
    Identification so_far = answer;
    so_far.parameters = parameters_so_far(at.unknowns);
    so_far.steps = step_fits(objective);
    so_far.fit.iterations = static_cast<int>(answer.trace.size());
    so_far.fit.solves = model.solves();
    so_far.fit.load_cases = model.load_cases();
    options.on_estimate(so_far);
  };
  Starts starts;
  Optimum optimum = options.start_is_answer ? optimise_annealed(objective, start, loss, optimiser, progress)
                                            : optimise_from_several(objective, start, loss, optimiser, progress, starts);
  loss = optimum.loss;
  if (!starts.minima.empty()) answer.provenance["starts of the search"] = to_words(starts);
  if (const auto several = several_minima(starts)) answer.verdicts.push_back(*several);

  // False: there is no optimum to look at.
  const auto take = [&] {
    answer.termination = optimum.termination;
    answer.message = optimum.message;
    if (optimum.evaluation.usable) return true;
    answer.fit.solves = model.solves();
    answer.fit.load_cases = model.load_cases();
    if (optimum.termination == Termination::cancelled) return false;
    answer.verdicts.push_back({"not_converged", "The simulation found no equilibrium (" + optimum.message +
                                                    "): check the loads, the supports and the material."});
    return false;
  };
  if (!take()) return answer;

  std::optional<Recording> there;
  if (looks.left > 0 && optimum.termination != Termination::cancelled)
    there = with_contacts_found(recording, model, optimum.unknowns);
  if (there) {
    std::list<FinerModel> meshes;
    const auto pushed_there = [&](const FinerModel* mesh) -> const FinerModel* {
      if (mesh == nullptr) return nullptr;
      meshes.push_back(*mesh);
      meshes.back().recording.pushes = there->pushes;
      return &meshes.back();
    };
    std::list<FinerMesh> taken;
    FitOptions next = options;
    next.young_start_pa = std::exp(optimum.unknowns(log_young));
    next.poisson_start = optimum.unknowns(poisson);
    next.start_is_answer = true;
    if (options.take_finer) {
      next.take_finer = [&](const MeshDoubt& found) -> const FinerMesh* {
        const FinerMesh* better = options.take_finer(found);
        if (better == nullptr) return nullptr;
        taken.push_back({pushed_there(better->mesh), pushed_there(better->finer)});
        return &taken.back();
      };
    }
    // What is solved for there is of no use to a next fit: no memory of it.
    Identification at_last = fit_around(*there, object, inputs, next, on_progress, pushed_there(finer), nullptr, doubt,
                                        {looks.left - 1, around(optimum, unknowns)});
    for (FitIteration& iteration : at_last.trace) iteration.round += round;
    at_last.trace.insert(at_last.trace.begin(), answer.trace.begin(), answer.trace.end());
    at_last.provenance.merge(answer.provenance);
    at_last.verdicts.insert(at_last.verdicts.begin(), answer.verdicts.begin(), answer.verdicts.end());
    at_last.fit.solves += model.solves();
    at_last.fit.load_cases += model.load_cases();
    return at_last;
  }

  ResidualSummary residuals;
  const auto optimise_again = [&] {
    Optimum again = optimise(objective, optimum.unknowns, loss, optimiser, progress);
    if (again.termination == Termination::cancelled) {  // what was found before stays the answer
      answer.termination = optimum.termination = Termination::cancelled;
      answer.message = again.message;
      return false;
    }
    optimum = std::move(again);
    optimum.loss = loss;
    if (!take()) return false;
    residuals = objective.summarise(loss);
    return true;
  };
  SolveCount elsewhere;  // by other models than the fit's own
  const auto as_far_as_known = [&] {
    answer.fit.solves = model.solves() + elsewhere.solves;
    answer.fit.load_cases = model.load_cases() + elsewhere.load_cases;
    if (optimum.evaluation.usable) answer.parameters = parameters_so_far(optimum.unknowns);
    return answer;
  };
  // Neighbouring pixels err together. What they share within a frame alone is noise, which is integrated out; what else their means
  // have in common makes them count as fewer. With that, once more.
  const auto weigh_neighbours = [&] {
    Loss next = loss;
    double inflation = residuals.variance_inflation;
    if (!next.noise) {
      const auto found = shared_noise(objective, loss);
      if (found && found->terms.empty()) inflation = std::max(inflation, found->of_wide);
      if (found && !found->terms.empty()) next.noise = found;
    }
    if (next.noise) inflation /= next.noise->of_cells;
    next.surface_weight = inflation > 1.05 ? 1 / inflation : 1;
    if (next.weighs_like(loss)) return true;
    loss = next;
    return optimise_again();
  };
  residuals = objective.summarise(loss);
  if (!weigh_neighbours()) return as_far_as_known();

  double factor = 1;
  std::vector<int> moving;
  MatrixX hessian, covariance;
  const auto look_around = [&] {
    factor = residuals.points > 0 ? tukey_information_factor(loss.tukey) : 1;
    moving = free_unknowns(unknowns);
    MatrixX information = optimum.evaluation.information(factor);
    bound_young(information, unknowns);
    hessian = information(moving, moving);
    covariance = hessian.ldlt().solve(MatrixX::Identity(hessian.rows(), hessian.cols()));
  };
  look_around();

  // Before any finer mesh, so that all shapes have meshes alike.
  if (doubt != nullptr && !doubt->shapes.empty() && !doubt->effect && optimum.termination == Termination::converged) {
    doubt->effect = shape_effect(*doubt, recording, inputs, objective, optimum, loss, options, optimiser, progress, &elsewhere);
    if (doubt->effect && doubt->effect->better) return as_far_as_known();
  }
  if (doubt != nullptr && doubt->foot && !doubt->foot->effect && optimum.termination == Termination::converged) {
    doubt->foot->effect = foot_effect(*doubt->foot, recording, object, objective, optimum, loss, options, progress);
    if (doubt->foot->effect)
      for (const AnswerShift& shift : *doubt->foot->effect) elsewhere.load_cases += shift.load_cases;
  }

  // What the mesh does to the answer, and finer ones until that is little.
  const FinerModel* meshed = nullptr;  // the mesh that corrects the model; nullptr: its own
  std::unique_ptr<MeshCorrection> correction;
  std::optional<AnswerShift> mesh;
  // No mesh need be finer than what else is known of E.
  const auto young_stds_known = [&] {
    std::vector<double> out = young_stds(unknowns, covariance, moving);
    if (doubt == nullptr || !doubt->effect) return out;
    for (std::size_t r = 0; r < out.size(); ++r)
      for (const AnswerShift& shift : doubt->effect->shifts) out[r] = std::hypot(out[r], shift.of_region(static_cast<Index>(r)).log_young);
    return out;
  };
  while (finer != nullptr && optimum.termination == Termination::converged) {
    const auto shown_by = [&](const FinerModel& by, std::shared_ptr<ForwardModel::Solved>* solved) {
      auto shift = mesh_shift(meshed ? meshed->recording : recording, meshed ? meshed->object : object, objective, optimum, loss,
                              by, options, progress, solved);
      if (shift) elsewhere.load_cases += shift->load_cases;
      return shift;
    };
    mesh = shown_by(*finer, memory != nullptr ? &memory->finer : nullptr);
    if (!mesh || !options.take_finer) break;
    const FinerMesh* better =
        options.take_finer({*mesh, young_stds_known(),
                            [&](const FinerModel& by) { return shown_by(by, nullptr); }});
    if (better == nullptr) break;
    bool corrected = MeshCorrection::applies_to(model);
    if (corrected) {
      auto next = std::make_unique<MeshCorrection>(*better->mesh, inputs, options, optimum.unknowns(poisson));
      corrected = next->correct(objective, optimum.unknowns, loss, progress) && optimise_again() && weigh_neighbours();
      if (correction) elsewhere.solves += correction->model().solves();
      elsewhere.load_cases += next->model().load_cases();
      correction = std::move(next);
    }
    if (!corrected) return as_far_as_known();
    meshed = better->mesh;
    finer = better->finer;
    mesh.reset();
    look_around();
  }
  answer.fit.iterations = optimum.iterations;
  const ReuseWhile reuse(model, optimiser.reuse);  // what follows looks at the optimum and close around it
  answer.nuisances = nuisances_from(objective, optimum, covariance, moving);
  const FitSummary summary = summary_of(unknowns, optimum, residuals);
  answer.fit.points_used = summary.points_used;
  answer.fit.rms_m = summary.rms_m;
  answer.fit.chi2_per_dof = summary.chi2_per_dof;
  answer.steps = step_fits(objective);
  add_bands(answer.steps, objective, covariance, moving);

  const Posterior posterior = explore_posterior(objective, optimum, loss, factor, progress);
  answer.budget = error_budget(unknowns, posterior.cancelled ? hessian : with_bounded_poisson(hessian, moving, posterior.poisson_std()), moving,
                               object.region_names);
  if (posterior.cancelled) {
    answer.termination = Termination::cancelled;
    answer.message = "stopped by the caller";
    return as_far_as_known();
  }
  std::vector<Posterior> regions{posterior};
  for (Index r = 1; r <= unknowns.ratio_count(); ++r) regions.push_back(posterior.of_region(r));
  OwnPoisson own = own_poisson(unknowns, optimum, covariance, moving);
  const auto move_by = [&](const AnswerShift& shift) {
    for (std::size_t r = 0; r < regions.size(); ++r)
      move(regions[r], shift.of_region(static_cast<Index>(r)), unknowns[poisson].lower, unknowns[poisson].upper);
    own.move(shift);
  };
  std::vector<AnswerShift> shared_errors;
  const auto widen_by = [&](const char* name, const std::vector<AnswerShift>& independent) {
    BudgetEntry entry{name};
    VectorX percent = VectorX::Zero(static_cast<Index>(regions.size()));
    for (const AnswerShift& shift : independent) {
      widen_together(regions, shift, unknowns[poisson].lower, unknowns[poisson].upper);
      for (std::size_t r = 0; r < regions.size(); ++r) {
        const Index region = static_cast<Index>(r);
        percent(region) = std::hypot(percent(region), 100 * shift.of_region(region).log_young);
      }
      entry.poisson_shift = std::hypot(entry.poisson_shift, shift.poisson);
      own.widen(shift);
      shared_errors.push_back(shift);
    }
    set_young(entry, percent, object.region_names);
    answer.budget.push_back(entry);
    sort_by_share(answer.budget);
  };
  if (mesh) {
    move_by(*mesh);
    widen_by("mesh", {mesh->times(finer->unsure)});
  }
  if (doubt != nullptr && doubt->effect) {
    move_by(doubt->effect->move);
    widen_by("unseen side", doubt->effect->shifts);
  }
  if (doubt != nullptr && doubt->foot && doubt->foot->effect) widen_by("foot", *doubt->foot->effect);
  answer.parameters = parameters_from(regions, own, unknowns, object.region_names);
  answer.covariance = with_shared(own.covariance_with(covariance_of(regions)), 1 + static_cast<Index>(regions.size()), shared_errors);
  answer.posterior = posterior_grid(regions.front());
  if (options.on_estimate) options.on_estimate(answer);
  const auto stopped = [&] {
    answer.termination = Termination::cancelled;
    answer.message = "stopped by the caller";
    return answer;
  };
  ForwardModel& solved_on = correction ? correction->model() : model;
  const ReuseWhile reuse_there(solved_on, optimiser.reuse);
  objective.evaluate(optimum.unknowns, loss);  // the last evaluation is the optimum again: what follows looks at it
  if (options.stresses && !add_stresses(answer.steps, solved_on, optimum.unknowns, progress)) return stopped();
  CrossChecks checks;
  Doubts doubts;
  std::optional<fem::Certificate> certificate;
  // Without cross-checks all that may be doubted is asked only where the fit's own unknowns, which cost nothing, ask for a slip.
  const auto asks_for_slip = [&] {
    const std::vector<int> follow = moving_unknowns(unknowns, optimum.unknowns, optimum.evaluation.gradient);
    const std::optional<Slip> slip = find_slip(objective, optimum, follow, factor, std::max(1.0, summary.chi2_per_dof));
    return slip && slip->p_value < rare;
  };
  const bool doubting = options.cross_checks || (options.find_slips && asks_for_slip());
  if (doubting && optimum.termination == Termination::converged) {
    doubts = look_for_doubts(recording, objective, optimum, inputs, options, factor, std::max(1.0, summary.chi2_per_dof),
                             progress, elsewhere, memory != nullptr ? &memory->doubted : nullptr);
    if (doubts.unrecorded_slip && doubts.unrecorded_slip->p_value < very_rare) answer.slip = doubts.unrecorded_slip;
  }
  if (options.cross_checks && optimum.termination == Termination::converged) {
    checks = cross_check(objective, optimum, loss, factor, answer.parameters[1].std, progress);
    if (checks.cancelled) return stopped();
    certificate = model.certify(optimum.unknowns);
    answer.budget_if = doubts.budget_if;
    answer.prediction = checks.held_out;
    if (regions.size() == 1) {  // of one region each, else
      answer.per_push = young_of_parts(checks.pushes);
      answer.per_site = young_of_parts(checks.sites);
    }
    answer.per_load = young_by_load(checks, model, answer.steps);
    // Six more fits of non-linear laws: unasked only where they take about as long as the answer did.
    constexpr Index most_nodes_solved = 40000;
    const bool cheap = object.mesh.nodes_m.rows() * static_cast<Index>(model.step_count()) <= most_nodes_solved;
    if (options.compare_laws || (cheap && drifts_with_load(checks))) {
      LawComparison compared = compare_laws(recording, object, inputs, options, unknowns, optimum, progress);
      if (compared.cancelled) return stopped();
      answer.laws = std::move(compared.laws);
    }
  }
  answer.fit.solves = model.solves() + elsewhere.solves + (correction ? correction->model().solves() : 0);
  answer.fit.load_cases = model.load_cases() + elsewhere.load_cases;
  for (Verdict& verdict : judge({recording, objective, optimum, residuals, answer, checks, doubts, certificate}))
    answer.verdicts.push_back(std::move(verdict));
  if (auto unexplored = nu_not_explored(posterior)) answer.verdicts.push_back(std::move(*unexplored));
  if (doubt != nullptr && !doubt->shapes.empty()) answer.verdicts.push_back(partly_seen(*doubt));
  answer.provenance["variance inflation of correlated points"] = std::to_string((loss.noise ? loss.noise->of_cells : 1) / loss.surface_weight);
  if (loss.noise)
    answer.provenance["noise that neighbours share"] = fmt::format("{:.2g} of a point's standard deviation over {:.1f} mm",
                                                                   std::sqrt(loss.noise->correlation.share), 1e3 * loss.noise->correlation.length_m);
  if (certificate)
    answer.provenance["full solve of the hardest step"] =
        certificate->converged ? fmt::format("{:.1e} of its motion away from the answer", certificate->difference) : certificate->reason;
  answer.provenance["posterior"] = posterior.quadrature ? "quadrature over nu" : "Laplace";
  return answer;
}

}  // namespace

Identification fit(const Recording& recording, const SimulatedObject& object, const Inputs& inputs,
                   const FitOptions& options, const OnProgress& progress, const FinerModel* finer, FitMemory* memory,
                   ShapeDoubt* doubt) {
  check(options);
  return fit_around(recording, object, inputs, options, progress, finer, memory, doubt, {});
}

}  // namespace palpate::estimation
