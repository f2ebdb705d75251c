// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/deep_loads.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/core/quantity.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/fem/materials.hpp"

namespace palpate::estimation {
namespace {

constexpr double nearly = 0.7;  ///< of the limit: an E that makes a load beyond it look like that is a third too high

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

/// What is fitted without its deepest loads; nothing where these press with much less than the limit, or hardly any would be left.
std::optional<StepCounts> without_deepest(const Recording& recording, const StepCounts& now, double young_pa) {
  constexpr double same_level = 0.9;  // pushes are pressed in steps of about the same force
  double deepest_pa = 0;
  for (std::size_t p = 0; p < now.size(); ++p)
    for (std::size_t s = 0; s < now[p]; ++s) deepest_pa = std::max(deepest_pa, pressure_of(recording, recording.pushes[p].steps[s]));
  if (deepest_pa <= nearly * largest_pressure * young_pa) return std::nullopt;
  StepCounts out = steps_within_pressure(recording, 1, same_level * deepest_pa);
  for (std::size_t p = 0; p < now.size(); ++p) {
    out[p] = std::min(out[p], now[p]);
    const auto first = recording.pushes[p].steps.begin(), end = first + static_cast<std::ptrdiff_t>(out[p]);
    // One load alone knows little.
    if (out[p] < now[p] && std::count_if(first, end, [](const Step& step) { return force_of(step) > 0; }) < 2) return std::nullopt;
  }
  return out;
}

/// Some of the steps fitted by themselves, and nothing else asked: the answer, or none where they have none.
Identification fit_alone(const Recording& recording, const SimulatedObject& object, const Inputs& inputs, FitOptions options,
                         const StepCounts& steps, const OnProgress& progress) {
  options.cross_checks = options.find_slips = options.compare_laws = options.stresses = false;
  options.on_estimate = nullptr;
  options.take_finer = nullptr;
  Recording some = recording;
  keep_first_steps(some, steps);
  try {
    return fit(some, object, first_steps(inputs, recording, steps), options, progress);
  } catch (const Error&) {
    Identification none;
    none.termination = Termination::failed;
    return none;
  }
}

/// Do the lighter loads give a lower E than all together (a law that softens gives them a higher one)? Were all within the model, the
/// answer of all would be the better one, and the variance of the difference that of the lighter ones' less that of all (Hausman,
/// Econometrica 46, 1978).
bool seems_stiffer(const Identification& lighter, const Identification& all) {
  constexpr double contact = 0.02;  // of E, that no load knows of its contact
  constexpr double rare = 2.33;     // standard deviations, to this side: one in a hundred
  if (lighter.termination != Termination::converged || all.termination != Termination::converged) return false;
  const auto variance = [](const Parameter& young) { return std::pow(std::log(young.upper_95 / young.lower_95) / 3.92, 2); };
  for (std::size_t k = 0; k < std::min(lighter.parameters.size(), all.parameters.size()); ++k) {
    const Parameter &some = lighter.parameters[k], &every = all.parameters[k];
    if (some.name != "young_modulus" || every.name != "young_modulus") continue;
    const double of_difference = std::max(0.0, variance(some) - variance(every)) + contact * contact;
    if (std::log(every.value / some.value) > rare * std::sqrt(of_difference)) return true;
  }
  return false;
}

/// @param with_them_pa  E with the lightest of them, where that is why they are left out
Verdict left_out(const Recording& recording, const StepCounts& counts, double young_pa, std::optional<double> with_them_pa) {
  std::string where;
  double highest = 0;
  for (std::size_t p = 0; p < counts.size(); ++p) {
    const Push& push = recording.pushes[p];
    if (counts[p] == push.steps.size()) continue;
    where += fmt::format("{}from step {} of push '{}' on", where.empty() ? "" : ", ", counts[p], push.name);
    for (const Step& step : push.steps) highest = std::max(highest, pressure_of(recording, step) / young_pa);
  }
  where.front() = static_cast<char>(std::toupper(where.front()));
  if (with_them_pa)
    return {"deep_loads_left_out",
            fmt::format("{} the tool presses with up to {:.2g} E (mean over its patch). From about {:.1f} E on a simulated patch of even pressure may "
                        "cave in, which no tool does, and E is {} by the lighter loads and would be {} with the next ones, which is more than "
                        "chance: the patch caves in, or the material stiffens. These steps are left out. Press less deep, or with a larger tool; "
                        "--all-loads fits them all.",
                        where, highest, nearly * largest_pressure, quantity(young_pa, "Pa"), quantity(*with_them_pa, "Pa"))};
  return {"deep_loads_left_out",
          fmt::format("{} the tool presses with more than {:.1f} E (up to {:.2g} E, mean over its patch): a simulated patch of even pressure caves "
                      "in under that, which no tool does. These steps are left out, and E is that of the lower loads. Press less deep, or with a "
                      "larger tool.",
                      where, largest_pressure, highest)};
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
                                   StepCounts* fitted, const OnProgress& progress) {
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
  FitSummary before;  // what earlier fits solved for
  const auto fit_now = [&] {
    before.solves += answer.fit.solves;
    before.load_cases += answer.fit.load_cases;
    answer = fit(now);
    young_pa = young_of(answer);
    if (answer.slip) slip = answer.slip;
  };
  for (int fits = 1;; ++fits) {
    fit_now();
    if (!caves_in || !young_pa || fits == most_fits) break;
    const StepCounts within = at_most(steps_within_pressure(recording, *young_pa));
    if (within == now || !any_loaded(recording, within)) break;
    now = within;
  }
  // Few loads may not tell from a law or a nuisance that the tool slid; what more of them told still holds.
  if (!answer.slip && slip && young_pa && slip->step < now[slip->push]) answer.slip = slip;
  std::optional<double> with_them_pa;
  // Whether a load is beyond is told by an E that it may have spoilt, and near the limit a surface may cave in or not: there the
  // deepest loads must not make E higher than the lighter ones have it. Not where a slip is in the way, which will be fitted next.
  for (int fewer = 0; caves_in && young_pa && !answer.slip && fewer < most_fits; ++fewer) {
    const std::optional<StepCounts> lighter = without_deepest(recording, now, *young_pa);
    if (!lighter) break;
    FitOptions from_there = options;
    from_there.young_start_pa = young_pa;
    const auto alone = [&](const StepCounts& steps) {
      const Identification found = fit_alone(recording, object, inputs, from_there, steps, progress);
      before.solves += found.fit.solves;
      before.load_cases += found.fit.load_cases;
      if (found.termination == Termination::cancelled) answer.termination = found.termination, answer.message = found.message;
      return found;
    };
    const Identification without = alone(*lighter);
    if (!seems_stiffer(without, alone(now)) || answer.termination == Termination::cancelled) break;
    if (!with_them_pa) with_them_pa = young_pa;
    now = *lighter;
    fit_now();
  }
  answer.fit.solves += before.solves;
  answer.fit.load_cases += before.load_cases;
  if (now != all && young_pa) answer.verdicts.push_back(left_out(recording, now, *young_pa, with_them_pa));
  if (fitted != nullptr) *fitted = now;
  return answer;
}

}  // namespace palpate::estimation
