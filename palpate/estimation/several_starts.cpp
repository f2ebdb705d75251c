// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/several_starts.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/quantity.hpp"

namespace palpate::estimation {
namespace {

constexpr double chi_square_95_of_two = 5.991;

/// Standard deviations of log E and nu as the optimum's own curvature has them; 0 for what is fixed.
std::pair<double, double> spread_at(const Optimum& at, const Unknowns& unknowns) {
  const std::vector<int> moving = free_unknowns(unknowns);
  const MatrixX information = at.evaluation.hessian(moving, moving);
  const auto std_of = [&](int unknown) {
    const auto place = std::find(moving.begin(), moving.end(), unknown);
    if (place == moving.end()) return 0.0;
    const Index k = place - moving.begin();
    const double variance = information.ldlt().solve(VectorX::Unit(information.rows(), k))(k);
    return std::isfinite(variance) && variance > 0 ? std::sqrt(variance) : std::numeric_limits<double>::infinity();
  };
  return {std_of(log_young), std_of(poisson)};
}

/// Whatever was solved before, so that candidates compare. Where no equilibrium is found from rest, from that of a stiffer body: a
/// search comes from there, too.
Evaluation evaluate_anew(Objective& objective, const VectorX& at, const Loss& loss, const OnProgress& progress) {
  objective.model().forget();
  Evaluation out = objective.evaluate(at, loss, progress);
  VectorX stiffer = at;
  for (int doubled = 1; doubled <= 3 && !out.usable && out.reason != "cancelled"; ++doubled) {
    stiffer(log_young) = std::min(at(log_young) + doubled * std::log(2.0), objective.unknowns()[log_young].upper);
    objective.model().forget();
    out = objective.evaluate(stiffer, loss, progress);
    for (int halved = doubled - 1; halved >= 0 && out.usable; --halved) {
      stiffer(log_young) = at(log_young) + halved * std::log(2.0);
      out = objective.evaluate(stiffer, loss, progress);
    }
  }
  return out;
}

}  // namespace

std::vector<Minimum> distinct_minima(std::vector<Minimum> found, double log_young_std, double poisson_std, double scale) {
  constexpr double apart = 2;                                   // standard deviations
  constexpr double least_log_young = 0.02, least_poisson = 0.01;  // what a search that has converged may leave
  std::stable_sort(found.begin(), found.end(), [](const Minimum& a, const Minimum& b) { return a.cost < b.cost; });
  const double young = std::max(least_log_young, apart * scale * log_young_std), nu = std::max(least_poisson, apart * scale * poisson_std);
  std::vector<Minimum> kept;
  for (const Minimum& one : found) {
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Minimum& other) {
      return std::abs(one.log_young - other.log_young) <= young && std::abs(one.poisson - other.poisson) <= nu;
    });
    if (!known && std::isfinite(one.cost)) kept.push_back(one);
  }
  return kept;
}

std::vector<Minimum> hardly_told_apart(const Starts& starts) {
  std::vector<Minimum> others;
  for (std::size_t k = 1; k < starts.minima.size(); ++k)
    if (2 * (starts.minima[k].cost - starts.minima[0].cost) < chi_square_95_of_two * starts.scale * starts.scale)
      others.push_back(starts.minima[k]);
  return others;
}

std::string to_words(const Starts& starts) {
  std::string words = fmt::format("{}{}; {}:", starts.tried, starts.tried > 1 ? " (from the first one the model did not fit)" : "",
                                  starts.minima.size() == 1 ? "minimum" : "minima");
  for (std::size_t k = 0; k < starts.minima.size(); ++k)
    words += fmt::format("{} E {}, nu {:.3f}, cost {:.1f}", k > 0 ? ";" : "", quantity(std::exp(starts.minima[k].log_young), "Pa"),
                         starts.minima[k].poisson, starts.minima[k].cost);
  return words;
}

Optimum optimise_from_several(Objective& objective, const VectorX& start, const Loss& final_loss, const OptimiseOptions& options,
                              const OnProgress& progress, Starts& starts) {
  constexpr double misfit = 1.5;  // robust spread of the residuals in standard deviations
  starts = {};
  std::vector<Minimum> found;
  const auto note = [&](const Optimum& at, double cost) {
    ++starts.tried;
    if (at.evaluation.usable) found.push_back({at.unknowns(log_young), at.unknowns(poisson), cost});
  };
  Optimum best = optimise_annealed(objective, start, final_loss, options, progress);
  if (best.termination == Termination::cancelled) return best;
  if (best.evaluation.usable && objective.residual_scale() < misfit) {
    note(best, best.evaluation.cost);
    starts.minima = found;
    return best;
  }

  // Candidates are compared by one loss, the widest: a narrow one would favour the fit that gives most points up.
  Loss common = best.evaluation.usable ? fitting_loss(objective, final_loss) : final_loss;
  bool cancelled = false;
  const auto cost_of = [&](const Optimum& at) {
    if (!at.evaluation.usable) return std::numeric_limits<double>::infinity();
    const Evaluation compared = evaluate_anew(objective, at.unknowns, common, progress);
    cancelled = compared.reason == "cancelled";
    return compared.usable ? compared.cost : std::numeric_limits<double>::infinity();
  };
  const auto stopped = [&] {
    best.termination = Termination::cancelled;
    best.message = "stopped by the caller";
    return best;
  };
  double lowest = cost_of(best);
  if (cancelled) return stopped();
  note(best, lowest);
  for (double factor : {0.25, 4.0}) {
    VectorX other = start;
    other(log_young) += std::log(factor);
    objective.model().forget();
    Optimum candidate = optimise_annealed(objective, other, final_loss, options, progress);
    if (candidate.termination == Termination::cancelled) return candidate;
    candidate.iterations += best.iterations;
    const double cost = cost_of(candidate);
    if (cancelled) return stopped();
    note(candidate, cost);
    if (cost < lowest) {
      lowest = cost;
      best = std::move(candidate);
    }
  }
  if (best.evaluation.usable) {  // the last evaluation is the answer's again
    Evaluation again = evaluate_anew(objective, best.unknowns, best.loss, progress);
    if (again.reason == "cancelled") return stopped();
    if (!again.usable) {
      best.termination = Termination::failed;
      best.message = again.reason;
    }
    best.evaluation = std::move(again);
  }
  if (best.evaluation.usable) {
    starts.scale = std::max(1.0, objective.residual_scale());
    const auto [log_young_std, poisson_std] = spread_at(best, objective.unknowns());
    starts.minima = distinct_minima(std::move(found), log_young_std, poisson_std, starts.scale);
  }
  return best;
}

Optimum optimise_from_several(Objective& objective, const VectorX& start, const Loss& final_loss, const OptimiseOptions& options,
                              const OnProgress& progress) {
  Starts starts;
  return optimise_from_several(objective, start, final_loss, options, progress, starts);
}

}  // namespace palpate::estimation
