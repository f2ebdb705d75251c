// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/optimise.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "palpate/estimation/held_poisson.hpp"
#include "palpate/fem/materials.hpp"

namespace palpate::estimation {
namespace {

constexpr double far_prior = 12;         // standard deviations of its prior that no nuisance leaves: the search must come back
constexpr double bends_more = 0.25;  // of log E: what linear theory takes a soft body for softer that bends away under its load
constexpr double hardly_a_gain = 0.01;  // of half of chi-square: a seventh of a standard deviation
constexpr std::size_t rough_steps = 5;  // of a long recording are enough to come near the optimum
constexpr double floor_gain = 0.5;      // of half of chi-square, that rays which change triangles hide
constexpr double of_a_ray = 4;          // what one ray costs at most (Tukey's loss at its usual cut: 3.7)
constexpr int most_crossings = 5;

MatrixX pick(const MatrixX& matrix, const std::vector<int>& which) {
  MatrixX out(static_cast<Index>(which.size()), static_cast<Index>(which.size()));
  for (std::size_t a = 0; a < which.size(); ++a) {
    for (std::size_t b = 0; b < which.size(); ++b) out(static_cast<Index>(a), static_cast<Index>(b)) = matrix(which[a], which[b]);
  }
  return out;
}

void keep_own_poisson_inside(const Unknowns& unknowns, VectorX& at) {
  for (int k = unknowns.first_own_poisson(); k < unknowns.parameter_count(); ++k) at(k) = std::clamp(at(k), unknowns[k].lower, unknowns[k].upper);
}

}  // namespace

std::vector<int> free_unknowns(const Unknowns& unknowns) {
  std::vector<int> moving;
  for (int k = 0; k < unknowns.size(); ++k) {
    if (!unknowns[k].fixed) moving.push_back(k);
  }
  return moving;
}

NewtonStep newton_step(const Evaluation& evaluation, const std::vector<int>& moving) {
  const VectorX gradient = evaluation.gradient(moving);
  NewtonStep out;
  out.move = MatrixX(evaluation.curvature(moving, moving)).ldlt().solve(-gradient);
  out.gain = -0.5 * gradient.dot(out.move);
  return out;
}

namespace {

Optimum search(Objective& objective, const VectorX& start, const Loss& loss, const OptimiseOptions& options,
               const OnProgress& progress) {
  const Unknowns& unknowns = objective.unknowns();
  ForwardModel& model = objective.model();
  const ReuseWhile reuse(model, options.reuse);
  Optimum best;
  best.unknowns = start;
  keep_own_poisson_inside(unknowns, best.unknowns);  // a caller's guess may lie outside
  constexpr double far_beyond = 5;  // the search comes back from there; an E of infinity is no body
  best.unknowns(log_young) =
      std::clamp(best.unknowns(log_young), unknowns[log_young].lower - far_beyond, unknowns[log_young].upper + far_beyond);
  best.evaluation = objective.evaluate(best.unknowns, loss, progress);
  if (!best.evaluation.usable) {
    best.termination = best.evaluation.reason == "cancelled" ? Termination::cancelled : Termination::failed;
    best.message = best.evaluation.reason;
    return best;
  }
  if (options.on_accepted) options.on_accepted(best, true);
  // The derivatives have been followed as far as they lead: from here on from a solution.
  const auto solve_anew = [&] {
    model.set_reuse(0);
    Evaluation solved = objective.evaluate(best.unknowns, loss, progress);
    model.set_reuse(options.reuse);
    if (!solved.usable) return false;
    best.evaluation = std::move(solved);
    return true;
  };
  double damping = 1e-6;
  VectorX last_move = VectorX::Zero(start.size());  // that was accepted
  int crossings = 0;
  for (best.iterations = 1; best.iterations <= options.max_iterations; ++best.iterations) {
    const std::vector<int> moving = moving_unknowns(unknowns, best.unknowns, best.evaluation.gradient);
    const MatrixX hessian = pick(best.evaluation.curvature, moving);
    VectorX gradient(static_cast<Index>(moving.size()));
    for (std::size_t k = 0; k < moving.size(); ++k) gradient(static_cast<Index>(k)) = best.evaluation.gradient(moving[k]);
    const VectorX scale = hessian.diagonal().cwiseMax(1e-300);
    if (options.enough_gain > 0 && newton_step(best.evaluation, moving).gain < options.enough_gain) {
      best.termination = Termination::converged;
      best.message = "converged";
      return best;
    }

    bool accepted = false;
    VectorX lowest_at;
    Evaluation lowest;  // of the attempts that were refused
    lowest.usable = false;
    for (int attempt = 0; attempt < 12 && !accepted; ++attempt) {
      MatrixX damped = hessian;
      damped.diagonal() += damping * scale;
      VectorX move = damped.ldlt().solve(-gradient);
      if (!move.allFinite()) {
        damping = std::max(1e-3, damping * 100);
        continue;
      }
      // Steps that go to and fro overshoot: of errors that turn by -r each, the end lies at 1 / (1 + r) of the step (Aitken 1926).
      const VectorX before = last_move(moving);
      const double size2 = before.cwiseAbs2().dot(scale);
      const double turns = size2 > 0 ? -before.cwiseProduct(scale).dot(move) / size2 : 0;
      if (attempt == 0 && turns > 0.3) move /= 1 + std::min(turns, 1.0);
      VectorX next = best.unknowns;
      for (std::size_t k = 0; k < moving.size(); ++k) next(moving[k]) += move(static_cast<Index>(k));
      // A step of log E, in any region, beyond a factor of five leaves every linearisation behind.
      double jump = std::abs(next(log_young) - best.unknowns(log_young));
      for (int k = first_ratio; k < unknowns.first_own_poisson(); ++k) jump = std::max(jump, std::abs(next(k) - best.unknowns(k)));
      if (jump > 1.6) next = best.unknowns + (1.6 / jump) * (next - best.unknowns);
      for (int k : moving) {
        const Unknown& unknown = unknowns[k];
        if (!std::isfinite(unknown.prior_std)) continue;
        const double reach = far_prior * unknown.prior_std;
        next(k) = std::clamp(next(k), unknown.prior_mean - reach, unknown.prior_mean + reach);
      }
      next(log_young) = std::clamp(next(log_young), unknowns[log_young].lower, unknowns[log_young].upper);
      next(poisson) = std::clamp(next(poisson), unknowns[poisson].lower, unknowns[poisson].upper);
      keep_own_poisson_inside(unknowns, next);

      Evaluation trial = objective.evaluate(next, loss, progress);
      if (trial.reason == "cancelled") {
        best.termination = Termination::cancelled;
        best.message = "stopped by the caller";
        return best;
      }
      const double tiny = 1e-10 * (1 + std::abs(best.evaluation.cost));
      if (!trial.usable || trial.cost > best.evaluation.cost + tiny) {
        damping = std::max(1e-4, damping * 10);
        if (!trial.usable) best.message = trial.reason;
        if (trial.usable && !(lowest.usable && lowest.cost <= trial.cost)) {
          lowest = std::move(trial);
          lowest_at = next;
        }
        continue;
      }
      accepted = true;
      damping = std::max(1e-9, damping / 10);
      const MatrixX covariance = hessian.ldlt().solve(MatrixX::Identity(hessian.rows(), hessian.cols()));
      double largest = 0;
      for (std::size_t k = 0; k < moving.size(); ++k) {
        if (moving[k] >= unknowns.parameter_count()) continue;
        const double std_dev = std::sqrt(std::max(covariance(static_cast<Index>(k), static_cast<Index>(k)), 1e-24));
        largest = std::max(largest, std::abs(next(moving[k]) - best.unknowns(moving[k])) / std::max(std_dev, 1e-9));
      }
      const double gain = best.evaluation.cost - trial.cost;
      last_move = next - best.unknowns;
      best.unknowns = next;
      best.evaluation = std::move(trial);
      if (options.on_accepted) options.on_accepted(best, false);
      // Rays that change triangles leave a floor on which steps of a hundredth of a standard deviation go to and fro.
      if ((largest < options.step_tolerance && gain < 1e-3) || (largest < 0.02 && gain < 1e-4)) {
        if (model.reuse_error() <= options.reuse_error) {
          best.termination = Termination::converged;
          best.message = "converged";
          return best;
        }
        solve_anew();
      }
    }
    if (!accepted && model.reuse_error() > options.reuse_error && solve_anew()) continue;
    if (!accepted) {
      // Correspondences that flip between triangles leave a floor; a step that nothing improves on is the end.
      const bool at_floor = newton_step(best.evaluation, moving).gain < floor_gain;
      // Where a ray comes to meet something else the cost jumps, and no step is short enough not to go over it: a search that has much to
      // gain beyond goes.
      if (!at_floor && lowest.usable && lowest.cost - best.evaluation.cost < of_a_ray && crossings < most_crossings) {
        ++crossings;
        best.unknowns = lowest_at;
        best.evaluation = std::move(lowest);
        if (options.on_accepted) options.on_accepted(best, false);
        last_move.setZero();
        damping = 1e-6;
        continue;
      }
      objective.evaluate(best.unknowns, loss, progress);
      best.termination = at_floor ? Termination::converged : Termination::no_progress;
      best.message = best.termination == Termination::converged ? "converged" : "no step improves the fit: " + best.message;
      return best;
    }
  }
  // Along a valley that hardly falls (nu of a single light push, say) small steps go on for long, and change nothing that counts.
  const std::vector<int> moving = moving_unknowns(unknowns, best.unknowns, best.evaluation.gradient);
  const double little = options.enough_gain > 0 ? std::min(options.enough_gain, hardly_a_gain) : hardly_a_gain;
  const bool there = newton_step(best.evaluation, moving).gain < little && model.reuse_error() <= options.reuse_error;
  best.termination = there ? Termination::converged : Termination::max_iterations;
  best.message = there ? "converged" : "stopped after " + std::to_string(options.max_iterations) + " iterations";
  return best;
}

}  // namespace

Optimum optimise(Objective& objective, const VectorX& start, const Loss& loss, const OptimiseOptions& options,
                 const OnProgress& progress) {
  Optimum best = search(objective, start, loss, options, progress);
  if (best.evaluation.usable) note_held(objective.unknowns(), best);  // the last step may be the one that came to the bound
  return best;
}

Optimum optimise_annealed(Objective& objective, const VectorX& start, const Loss& final_loss, const OptimiseOptions& options,
                          const OnProgress& progress) {
  Loss loss = final_loss;
  loss.along_rays = false;
  loss.surface_weight = 1;
  loss.every = std::max<std::size_t>(1, objective.model().step_count() / rough_steps);
  loss.tukey = 1e6;
  Optimum at;
  at.unknowns = start;
  Evaluation first = objective.evaluate(start, loss, progress);
  // Too soft a start does not bear the load.
  for (int stiffer = 0; !first.usable && first.reason != "cancelled" && stiffer < 4; ++stiffer) {
    at.unknowns(log_young) = std::min(at.unknowns(log_young) + std::log(2.0), objective.unknowns()[log_young].upper);
    objective.model().forget();
    first = objective.evaluate(at.unknowns, loss, progress);
  }
  if (!first.usable) {
    at.message = first.reason;
    at.termination = first.reason == "cancelled" ? Termination::cancelled : Termination::failed;
    return at;
  }
  int iterations = 0;
  const auto cut = [&](double tukey) {
    loss.tukey = tukey;
    loss.widening = tukey / final_loss.tukey;
  };
  cut(std::max(final_loss.tukey, 4 * final_loss.tukey * objective.residual_scale()));
  OptimiseOptions rough = options;
  rough.max_iterations = 4;
  rough.step_tolerance = 0.1;
  rough.reuse = 0.1;
  rough.reuse_error = 1e-2;
  while (loss.tukey > 2 * final_loss.tukey) {
    at = optimise(objective, at.unknowns, loss, rough, progress);
    iterations += at.iterations;
    if (at.termination == Termination::failed || at.termination == Termination::cancelled) return at;
    cut(std::max(final_loss.tukey, std::min(loss.tukey / 3, 4 * final_loss.tukey * objective.residual_scale())));
  }
  if (loss.every > 1) {  // the optimum of a few steps is where the fit of all of them starts
    cut(2 * final_loss.tukey);
    at = optimise(objective, at.unknowns, loss, options, progress);
    iterations += at.iterations;
    if (at.termination == Termination::failed || at.termination == Termination::cancelled) return at;
    loss.every = 1;
  }
  // Where the model does not fit, the cut follows the residuals' spread: a fit that calls everything an outlier has no say.
  Loss last = fitting_loss(objective, final_loss);
  if (final_loss.along_rays) {
    cut(2 * final_loss.tukey);
    loss.along_rays = true;
    at = optimise(objective, at.unknowns, loss, rough, progress);
    iterations += at.iterations;
    if (at.termination == Termination::failed || at.termination == Termination::cancelled) return at;
    last = objective.with_chosen_rays(last);
  }
  at = optimise(objective, at.unknowns, last, options, progress);
  at.loss = last;
  // A better fit has a narrower spread: tighten while that helps.
  for (int round = 0; round < 6 && at.evaluation.usable && at.termination != Termination::cancelled; ++round) {
    Loss tighter = fitting_loss(objective, final_loss);
    if (tighter.tukey > 0.9 * at.loss.tukey) break;
    tighter.rays = at.loss.rays;
    iterations += at.iterations;
    at = optimise(objective, at.unknowns, tighter, options, progress);
    at.loss = tighter;
  }
  at.iterations += iterations;
  return at;
}

Loss fitting_loss(const Objective& objective, const Loss& loss) {
  Loss wider = loss;
  wider.tukey = loss.tukey * std::max(1.0, objective.residual_scale());
  return wider;
}

namespace {

bool is_linear(const ForwardModel& model) { return fem::material_law(model.object().material).is_linear(); }

double force_of(const ForwardModel& model, std::size_t s) {
  double force_n = 0;
  for (const Load& load : model.step(s).loads) force_n = std::max(force_n, load.force_n.value_or(Vec3::Zero()).norm());
  return force_n;
}

/// A modulus at which the body hardly moves: non-linear materials are then linear too. Not stiffer than that: what a table presses into
/// the body must stay far above the last digit of its nodes' places.
double stiff_young_pa(double force_n, double size_m) {
  constexpr double over_pressure = 1e5;
  return force_n > 0 ? std::clamp(over_pressure * force_n / (size_m * size_m), 1e6, 1e9) : 1e9;
}

/// Steps that linear theory is asked about: a few of a long recording say enough. A non-linear body may bulge or dodge under its
/// full load, and a start that is too soft for it may end on another equilibrium: there, those of up to half the highest force.
std::vector<std::size_t> steps_to_start_with(const Objective& objective, const ForwardModel& model, double highest_n) {
  constexpr double light = 0.55;  // half, and what a controller misses it by
  std::vector<std::size_t> all, lighter;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    if (!objective.sees(s)) continue;
    all.push_back(s);
    const double force_n = force_of(model, s);
    if (force_n > 0.1 * highest_n && force_n < light * highest_n) lighter.push_back(s);
  }
  const auto& chosen = is_linear(model) || lighter.empty() ? all : lighter;
  const std::size_t stride = std::max<std::size_t>(1, chosen.size() / 24);
  std::vector<std::size_t> some;
  for (std::size_t k = 0; k < chosen.size(); k += stride) some.push_back(chosen[k]);
  return some;
}

std::vector<std::size_t> usable_steps(const std::vector<StepPrediction>& predicted) {
  std::vector<std::size_t> steps;
  for (std::size_t s = 0; s < predicted.size(); ++s)
    if (predicted[s].surface_m.rows() > 0) steps.push_back(s);
  return steps;
}

/// A handful of `steps`, where E moves the surface most or, where motions are imposed, the force; in their order.
std::vector<std::size_t> moved_most(const std::vector<StepPrediction>& predicted, std::vector<std::size_t> steps) {
  constexpr std::size_t most = 6;
  if (steps.size() <= most) return steps;
  std::vector<std::pair<double, double>> effect(predicted.size());
  for (std::size_t s : steps) {
    effect[s].first = predicted[s].d_surface.col(0).cwiseAbs().maxCoeff();
    for (const auto& force : predicted[s].d_force) effect[s].second = std::max(effect[s].second, force.col(0).norm());
  }
  std::stable_sort(steps.begin(), steps.end(), [&](std::size_t a, std::size_t b) { return effect[a] > effect[b]; });
  steps.resize(most);
  std::sort(steps.begin(), steps.end());
  return steps;
}

}  // namespace

VectorX find_start(Objective& objective, double poisson_start) {
  ForwardModel& model = objective.model();
  const Unknowns& unknowns = objective.unknowns();
  VectorX guess = unknowns.prior_mean();
  guess(poisson) = std::clamp(poisson_start, unknowns[poisson].lower, unknowns[poisson].upper);

  const auto& rest = model.object().surface.rest().vertices_m;
  const double size_m = (rest.colwise().maxCoeff() - rest.colwise().minCoeff()).norm();
  double highest_n = 0;
  for (std::size_t s = 0; s < model.step_count(); ++s) highest_n = std::max(highest_n, force_of(model, s));
  guess(log_young) = std::log(stiff_young_pa(highest_n, size_m));
  std::vector<StepPrediction> stiff(model.step_count());
  for (std::size_t s : steps_to_start_with(objective, model, highest_n)) {
    stiff[s] = model.predict(s, guess);
    if (!stiff[s].converged) stiff[s] = {};
  }
  model.forget();

  Loss wide;
  wide.tukey = 1e3;
  wide.along_rays = false;
  wide.most_points = 400;  // a modulus to start from shows in so many
  double best_cost = std::numeric_limits<double>::infinity();
  constexpr double softest = 1.5, stiffest = 11.5, hardly = 1e-3, alike = 1e-2;
  double best_decade = stiffest;  // where all that is softer moves farther than the object is long
  std::vector<StepPrediction> scaled = stiff;  // once: derivatives are large, and stay what they are
  // @returns the cost where the surface hardly moves
  const auto try_at = [&](double decade, const std::vector<std::size_t>& steps) -> std::optional<double> {
    const double ratio = std::exp(guess(log_young) - decade * std::log(10.0));
    bool sensible = true, hardly_moves = true;
    for (std::size_t s : steps) {
      StepPrediction& prediction = scaled[s];
      prediction.surface_m = stiff[s].surface_m;
      prediction.material_m = stiff[s].material_m;
      prediction.force_n = stiff[s].force_n;
      prediction.travel_m = stiff[s].travel_m;
      // The part that scales with 1/E is the derivative to -log E; imposed motions do not scale.
      const VectorX loaded = -prediction.d_surface.col(0);
      for (Index v = 0; v < prediction.surface_m.rows(); ++v) {
        prediction.surface_m.row(v) += (ratio - 1) * loaded.segment<3>(3 * v).transpose();
      }
      if (prediction.field != nullptr) {
        const VectorX material = -prediction.d_markers().col(0);
        for (Index v = 0; v < prediction.material_m.rows(); ++v)
          prediction.material_m.row(v) += (ratio - 1) * material.segment<3>(3 * v).transpose();
      }
      const double moves_m = ratio * loaded.cwiseAbs().maxCoeff();
      sensible = sensible && moves_m < size_m;
      hardly_moves = hardly_moves && moves_m < hardly * size_m;
      for (const auto& force : prediction.d_force) hardly_moves = hardly_moves && force.col(0).isZero(0);
      for (std::size_t l = 0; l < prediction.force_n.size(); ++l) {
        prediction.force_n[l] += (1 / ratio - 1) * prediction.d_force[l].col(0);
        prediction.travel_m(static_cast<Index>(l)) -= (ratio - 1) * prediction.d_travel(static_cast<Index>(l), 0);
      }
    }
    if (!sensible) return {};
    const double cost = objective.cost_of(scaled, steps, guess, wide);
    if (cost < best_cost) {
      best_cost = cost;
      best_decade = decade;
    }
    return hardly_moves ? std::optional(cost) : std::nullopt;
  };
  // Half decades first: at the worst of them the displacement is 0.8 of itself off, still less than no displacement is. The steps that
  // move most tell them apart; beside the best one the others have a say, too, up to where the next one would have led.
  const std::vector<std::size_t> known = usable_steps(stiff), few = moved_most(stiff, known);
  std::optional<double> before;
  for (double decade = softest; decade <= stiffest; decade += 0.5) {
    const std::optional<double> still = try_at(decade, few);
    if (still && before && std::abs(*still - *before) < alike) break;  // all that is stiffer looks as if nothing moved
    before = still;
  }
  const double rough = best_decade;
  if (few.size() < known.size()) {
    best_cost = std::numeric_limits<double>::infinity();
    try_at(rough, known);
  }
  for (double off : {-0.375, -0.25, -0.125, 0.125, 0.25, 0.375}) try_at(rough + off, known);
  const double fine = best_decade;
  for (double off : {-0.0625, 0.0625}) try_at(fine + off, known);
  guess(log_young) = best_decade * std::log(10.0);
  if (!is_linear(model)) guess(log_young) += bends_more;
  return guess;
}

}  // namespace palpate::estimation
