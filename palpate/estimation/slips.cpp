// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/slips.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "palpate/core/quantity.hpp"
#include "palpate/estimation/homogeneity.hpp"

namespace palpate::estimation {
namespace {

int slips_up_to(const Push& push, std::size_t step) {
  const auto last = push.steps.begin() + static_cast<std::ptrdiff_t>(std::min(step + 1, push.steps.size()));
  return static_cast<int>(std::count_if(push.steps.begin(), last, [](const Step& one) { return one.slipped; }));
}

/// What one step's rows say of all unknowns, priors left out of those that may slip.
struct SaidByStep {
  std::size_t step = 0;
  MatrixX information;  ///< all x those
  VectorX gradient;     ///< those
};

/// Steps of a push that share contact and zero, in their order.
struct Stretch {
  std::size_t push = 0;
  std::vector<int> those;
  std::vector<SaidByStep> steps;
};

std::vector<Stretch> stretches(const Objective& objective, const Optimum& optimum, double factor) {
  const ForwardModel& model = objective.model();
  const Unknowns& unknowns = objective.unknowns();
  std::vector<Stretch> all;
  std::string name;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    const StepIndex at = model.index(s);
    const bool fresh = all.empty() || all.back().push != at.push || name != stretch_of(model.push(s), at.step);
    if (fresh) {
      name = stretch_of(model.push(s), at.step);
      all.push_back({at.push, unknowns.named({"contact_shift" + name + "_1", "contact_shift" + name + "_2", "travel_zero" + name}), {}});
    }
    Stretch& now = all.back();
    const std::vector<Load>& loads = model.step(s).loads;
    const bool loaded = std::any_of(loads.begin(), loads.end(), [](const Load& load) { return load.force_n && load.force_n->norm() > 0; });
    if (now.those.empty() || !loaded || s >= objective.last_rows().size() || objective.last_rows()[s].empty()) continue;
    const Evaluation said = objective.of_step(s, optimum.unknowns, optimum.loss);
    SaidByStep one{at.step, said.information(factor)(Eigen::all, now.those), said.gradient(now.those)};
    for (std::size_t j = 0; j < now.those.size(); ++j) {
      const int k = now.those[j];
      if (unknowns[k].fixed) continue;  // no prior was added: Objective::add_priors
      const double precision = std::pow(unknowns[k].prior_std, -2);
      one.information(k, static_cast<Index>(j)) -= precision;
      one.gradient(static_cast<Index>(j)) -= precision * (optimum.unknowns(k) - unknowns[k].prior_mean);
    }
    now.steps.push_back(std::move(one));
  }
  return all;
}

/// chi2 of an E that goes up or down with the load, from one added unknown: what a wrong law looks like, and a slip in a push of few steps.
double of_drift(const Objective& objective, const Optimum& optimum, const std::vector<int>& moving, const MatrixX& fitted, const VectorX& slope,
                double factor) {
  const Index size = static_cast<Index>(moving.size());
  const std::vector<double>& shares = objective.model().load_shares();
  MatrixX information = MatrixX::Zero(size + 1, size + 1);
  VectorX gradient = VectorX::Zero(size + 1);
  information.topLeftCorner(size, size) = fitted;
  gradient.head(size) = slope;
  for (std::size_t s = 0; s < objective.model().step_count(); ++s) {
    if (s >= objective.last_rows().size() || objective.last_rows()[s].empty()) continue;
    const Evaluation said = objective.of_step(s, optimum.unknowns, optimum.loss);
    const VectorX young = said.information(factor).col(log_young);
    for (Index k = 0; k < size; ++k) information(k, size) += shares[s] * young(moving[static_cast<std::size_t>(k)]);
    information(size, size) += shares[s] * shares[s] * young(log_young);
    gradient(size) += shares[s] * said.gradient(log_young);
  }
  information.row(size).head(size) = information.col(size).head(size).transpose();
  const Eigen::LDLT<MatrixX> factorised(information);
  if (factorised.info() != Eigen::Success || !factorised.isPositive()) return 0;
  const double asked = -factorised.solve(gradient)(size), variance = factorised.solve(VectorX(VectorX::Unit(size + 1, size)))(size);
  const double chi2 = asked * asked / variance;
  return std::isfinite(chi2) ? chi2 : 0;
}

}  // namespace

bool after_slip(const Push& push, std::size_t step) { return slips_up_to(push, step) > 0; }

std::string stretch_of(const Push& push, std::size_t step) {
  const int slips = slips_up_to(push, step);
  return "[" + push.name + (slips == 0 ? "" : slips == 1 ? ", slipped" : ", slipped " + std::to_string(slips) + " times") + "]";
}

double slip_std_m(const Tool& tool) {
  constexpr double share = 0.5, otherwise_m = 0.005;
  return tool.radius_m > 0 ? share * tool.radius_m : otherwise_m;
}

void free_contacts_after_slips(Recording& recording) {
  for (Push& push : recording.pushes) {
    for (std::size_t s = 0; s < push.steps.size(); ++s) {
      if (!after_slip(push, s)) continue;
      for (Load& load : push.steps[s].loads) {
        const auto tool = std::find_if(recording.tools.begin(), recording.tools.end(), [&](const Tool& one) { return one.name == load.tool; });
        if (tool != recording.tools.end() && load.force_n) load.contact_std_m = std::max(load.contact_std_m, slip_std_m(*tool));
      }
    }
  }
}

void take_slips(const Recording& from, Recording& to) {
  for (std::size_t p = 0; p < std::min(from.pushes.size(), to.pushes.size()); ++p)
    for (std::size_t s = 0; s < std::min(from.pushes[p].steps.size(), to.pushes[p].steps.size()); ++s)
      to.pushes[p].steps[s].slipped = from.pushes[p].steps[s].slipped;
  free_contacts_after_slips(to);
}

std::optional<Slip> find_slip(const Objective& objective, const Optimum& optimum, const std::vector<int>& moving, double factor,
                              double misfit, double otherwise_chi2) {
  const MatrixX fitted = optimum.evaluation.information(factor)(moving, moving);
  const VectorX slope = optimum.evaluation.gradient(moving);
  std::optional<Slip> best;
  int places = 0;
  for (const Stretch& stretch : stretches(objective, optimum, factor)) {
    const Index size = static_cast<Index>(moving.size()), count = static_cast<Index>(stretch.those.size());
    MatrixX information = MatrixX::Zero(size + count, size + count);
    VectorX gradient = VectorX::Zero(size + count);
    information.topLeftCorner(size, size) = fitted;
    gradient.head(size) = slope;
    for (std::size_t k = stretch.steps.size(); k-- > 1;) {  // from the last step back: one step more that touches elsewhere
      const SaidByStep& said = stretch.steps[k];
      information.topRightCorner(size, count) += said.information(moving, Eigen::all);
      information.bottomLeftCorner(count, size) = information.topRightCorner(size, count).transpose();
      information.bottomRightCorner(count, count) += said.information(stretch.those, Eigen::all);
      gradient.tail(count) += said.gradient;
      ++places;
      // What the data do not tell at all (a travel that nobody read) is no part of the test.
      MatrixX held = information;
      const double least = 1e-12 * held.diagonal().head(size).maxCoeff();
      for (Index j = size; j < size + count; ++j) held(j, j) = std::max(held(j, j), least) * (1 + 1e-9);
      const Eigen::LDLT<MatrixX> factorised(held);
      if (factorised.info() != Eigen::Success || !factorised.isPositive()) continue;
      const VectorX asked = -factorised.solve(gradient).tail(count);
      const MatrixX covariance = factorised.solve(MatrixX(MatrixX::Identity(size + count, size + count).rightCols(count))).bottomRows(count);
      const double chi2 = asked.dot(covariance.ldlt().solve(asked)) / misfit;
      if (!std::isfinite(chi2) || (best && chi2 <= best->chi2)) continue;
      Slip slip{stretch.push, said.step, 0, 0, chi2, chi_square_tail(chi2, static_cast<int>(count))};
      for (Index j = 0; j < count; ++j) {
        const bool travel = objective.unknowns()[stretch.those[static_cast<std::size_t>(j)]].name.rfind("travel_zero", 0) == 0;
        (travel ? slip.deeper_m : slip.across_m) = travel ? asked(j) : std::hypot(slip.across_m, asked(j));
      }
      best = slip;
    }
  }
  if (!best) return best;
  constexpr double for_more_numbers = 4;  // three unknowns explain more than one by chance alone
  const double drift_chi2 = of_drift(objective, optimum, moving, fitted, slope, factor) / misfit;
  if (best->chi2 < std::max(drift_chi2, otherwise_chi2) + for_more_numbers) return std::nullopt;
  best->p_value = std::min(1.0, best->p_value * places);
  return best;
}

Identification fit_with_slips(Recording& recording, const std::function<Identification(const Identification* before)>& fit) {
  constexpr int most_slips = 2;
  std::vector<Verdict> found;
  Identification answer = fit(nullptr);
  while (answer.slip && static_cast<int>(found.size()) < most_slips) {
    const Slip slip = *answer.slip;
    const Recording as_it_was = recording;
    Push& push = recording.pushes[slip.push];
    push.steps[slip.step].slipped = true;
    free_contacts_after_slips(recording);
    Identification again = fit(&answer);
    if (again.termination != Termination::converged) {  // cancelled, or nothing that could be answered: as it was, with its verdict
      recording = as_it_was;
      if (again.termination == Termination::cancelled) answer.termination = again.termination, answer.message = again.message;
      break;
    }
    found.push_back({"contact_slipped",
                     fmt::format("The tool seems to have slipped at step {} of push '{}', by {:.2g} mm across and {:.2g} mm deeper. From there on "
                                 "where it touches and the zero of its travel are unknowns of their own (contact_shift{} and "
                                 "travel_zero{}); without that E would be {}. Push along the surface's normal, less deep, with a tip that sticks.",
                                 slip.step, push.name, 1e3 * slip.across_m, 1e3 * slip.deeper_m, stretch_of(push, slip.step),
                                 stretch_of(push, slip.step), quantity(answer.parameters.front().value, "Pa"))});
    again.fit.solves += answer.fit.solves;
    again.fit.load_cases += answer.fit.load_cases;
    answer = std::move(again);
  }
  answer.verdicts.insert(answer.verdicts.begin(), found.begin(), found.end());
  return answer;
}

}  // namespace palpate::estimation
