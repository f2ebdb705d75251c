// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/deep_loads.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/fem/materials.hpp"

namespace palpate::estimation {
namespace {

double force_of(const Step& step) {
  double force_n = 0;
  for (const Load& load : step.loads) force_n = std::max(force_n, load.force_n.value_or(Vec3::Zero()).norm());
  return force_n;
}

/// Highest mean pressure under a round tool of known force, Pa.
double pressure_of(const Recording& recording, const Step& step) {
  double highest_pa = 0;
  for (const Load& load : step.loads) {
    const auto tool = std::find_if(recording.tools.begin(), recording.tools.end(), [&](const Tool& one) { return one.name == load.tool; });
    if (tool == recording.tools.end() || !load.force_n || !(tool->radius_m > 0)) continue;
    if (tool->shape != ToolShape::sphere && tool->shape != ToolShape::disc) continue;
    const double force_n = std::abs(load.force_n->dot(load.direction.normalized()));
    highest_pa = std::max(highest_pa, force_n / (std::numbers::pi * tool->radius_m * tool->radius_m));
  }
  return highest_pa;
}

bool any_loaded(const Recording& recording, const StepCounts& counts) {
  for (std::size_t p = 0; p < counts.size(); ++p)
    for (std::size_t s = 0; s < counts[p]; ++s)
      if (force_of(recording.pushes[p].steps[s]) > 0) return true;
  return false;
}

/// E by linear theory from the lighter loads of each push: up to a third of its highest, at least the lightest one.
std::optional<double> rough_young_pa(const Recording& recording, const SimulatedObject& object, const Inputs& inputs,
                                     const FitOptions& options) {
  constexpr double light = 0.35, nothing = 0.02;  // of the highest force
  Recording lighter = recording;
  Inputs seen;
  std::size_t flat = 0;
  for (Push& push : lighter.pushes) {
    double highest_n = 0;
    for (const Step& step : push.steps) highest_n = std::max(highest_n, force_of(step));
    std::vector<Step> kept;
    const std::vector<Step> all = std::move(push.steps);
    bool loaded = false;
    for (const Step& step : all) {
      const double force_n = force_of(step);
      const bool is_loaded = force_n > nothing * highest_n;
      if (!is_loaded || force_n < light * highest_n || !loaded) {
        kept.push_back(step);
        seen.push_back(inputs[flat]);
      }
      loaded = loaded || is_loaded;
      ++flat;
    }
    push.steps = std::move(kept);
  }
  try {
    Unknowns unknowns;
    ForwardModel model(lighter, object, unknowns, statics_options(lighter, object, options));
    Objective objective(model, seen, unknowns);
    return std::exp(find_start(objective, recording.model.poisson_fixed.value_or(options.poisson_start))(log_young));
  } catch (const Error&) {  // the fit will say what is wrong
    return std::nullopt;
  }
}

/// Of the stiffest region, so that nothing is left out for what another part is made of.
std::optional<double> young_of(const Identification& answer) {
  std::optional<double> highest_pa;
  if (answer.termination != Termination::converged) return highest_pa;
  for (const Parameter& one : answer.parameters)
    if (one.name == "young_modulus" && std::isfinite(one.value)) highest_pa = std::max(highest_pa.value_or(0), one.value);
  return highest_pa;
}

Verdict left_out(const Recording& recording, const StepCounts& counts, double young_pa) {
  std::string where;
  double highest = 0;
  for (std::size_t p = 0; p < counts.size(); ++p) {
    const Push& push = recording.pushes[p];
    if (counts[p] == push.steps.size()) continue;
    where += fmt::format("{}from step {} of push '{}' on", where.empty() ? "" : ", ", counts[p], push.name);
    for (const Step& step : push.steps) highest = std::max(highest, pressure_of(recording, step) / young_pa);
  }
  return {"deep_loads_left_out",
          fmt::format("{} the tool presses with more than {:.1f} E (up to {:.2g} E, mean over its patch): a simulated patch of even pressure caves "
                      "in under that, which no tool does. These steps are left out, and E is that of the lower loads. Press less deep, or with a "
                      "larger tool.",
                      static_cast<char>(std::toupper(where.front())) + where.substr(1), largest_pressure, highest)};
}

}  // namespace

StepCounts all_steps(const Recording& recording) {
  StepCounts counts;
  for (const Push& push : recording.pushes) counts.push_back(push.steps.size());
  return counts;
}

StepCounts steps_within_pressure(const Recording& recording, double young_modulus_pa, double over_young) {
  StepCounts counts;
  for (const Push& push : recording.pushes) {
    const auto beyond = std::find_if(push.steps.begin(), push.steps.end(), [&](const Step& step) {
      return pressure_of(recording, step) > over_young * young_modulus_pa;
    });
    counts.push_back(static_cast<std::size_t>(beyond - push.steps.begin()));
  }
  return counts;
}

void keep_first_steps(Recording& recording, const StepCounts& counts) {
  for (std::size_t p = 0; p < counts.size(); ++p) recording.pushes[p].steps.resize(std::min(counts[p], recording.pushes[p].steps.size()));
}

Identification fit_within_pressure(const Recording& recording, const SimulatedObject& object, const Inputs& inputs,
                                   const FitOptions& options, const std::function<Identification(const StepCounts&)>& fit,
                                   StepCounts* fitted) {
  constexpr int most_fits = 3;
  constexpr double roughly = 1.5;  // by how much E may be off that linear theory reads
  const StepCounts all = all_steps(recording);
  const StepCounts most = fitted != nullptr && !fitted->empty() ? *fitted : all;
  const auto at_most = [&](StepCounts counts) {
    for (std::size_t p = 0; p < counts.size(); ++p) counts[p] = std::min(counts[p], most[p]);
    return counts;
  };
  StepCounts now = most;
  const bool caves_in = !fem::material_law(object.material).is_linear() && steps_within_pressure(recording, 0, 0) != all;
  if (caves_in)
    if (const auto rough_pa = options.young_start_pa ? options.young_start_pa : rough_young_pa(recording, object, inputs, options)) {
      const StepCounts near = at_most(steps_within_pressure(recording, *rough_pa, roughly * largest_pressure));
      if (any_loaded(recording, near)) now = near;
    }
  Identification answer;
  std::optional<double> young_pa;
  std::optional<Slip> slip;
  for (int fits = 1;; ++fits) {
    answer = fit(now);
    young_pa = young_of(answer);
    if (answer.slip) slip = answer.slip;
    if (!caves_in || !young_pa || fits == most_fits) break;
    const StepCounts within = at_most(steps_within_pressure(recording, *young_pa));
    if (within == now || !any_loaded(recording, within)) break;
    now = within;
  }
  // Few loads may not tell from a law or a nuisance that the tool slid; what more of them told still holds.
  if (!answer.slip && slip && young_pa && slip->step < now[slip->push]) answer.slip = slip;
  if (now != all && young_pa) answer.verdicts.push_back(left_out(recording, now, *young_pa));
  if (fitted != nullptr) *fitted = now;
  return answer;
}

}  // namespace palpate::estimation
