// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_methods.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/estimation/paper_method.hpp"
#include "palpate/estimation/slips.hpp"

namespace palpate::cli {
namespace {

constexpr const char* contact_slipped = "contact_slipped";

bool says(const MethodAnswer& answer, const char* verdict) {
  return std::find(answer.verdicts.begin(), answer.verdicts.end(), verdict) != answer.verdicts.end();
}

bool any_slip(const Recording& recording) {
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps)
      if (step.slipped) return true;
  return false;
}

/// The slips of a recording in the other models of what was prepared.
void tell_slips(const Recording& slipped, Prepared& given) {
  if (given.finer) {
    given.finer = std::make_shared<estimation::FinerModel>(*given.finer);
    estimation::take_slips(slipped, given.finer->recording);
  }
  if (given.doubt) {
    given.doubt = std::make_shared<estimation::ShapeDoubt>(*given.doubt);
    given.doubt->effect.reset();
    for (estimation::AlternativeShape& shape : given.doubt->shapes) estimation::take_slips(slipped, shape.recording);
  }
}

void count_too(const MethodAnswer& first, MethodAnswer& out) {
  out.solves += first.solves;
  out.load_cases += first.load_cases;
  out.iterations += first.iterations;
  out.seconds += first.seconds;
}

}  // namespace

MethodAnswer no_answer() {
  MethodAnswer out;
  out.young_modulus_pa = out.poisson_ratio = out.lower_95_pa = out.upper_95_pa = out.poisson_lower_95 = out.poisson_upper_95 =
      std::numeric_limits<double>::quiet_NaN();
  return out;
}

MethodAnswer summary(const Identification& answer, double seconds) {
  MethodAnswer out = no_answer();
  out.solves = answer.fit.solves;
  out.load_cases = answer.fit.load_cases;
  out.iterations = answer.fit.iterations;
  out.seconds = seconds;
  for (const Verdict& verdict : answer.verdicts) out.verdicts.push_back(verdict.code);
  // Stopped, or without an equilibrium at its start: where it stood then is no answer.
  if (answer.parameters.size() < 2 || answer.termination == Termination::failed) return out;
  const Parameter &young = answer.parameters[0], &poisson = answer.parameters[1];
  out.young_modulus_pa = young.value;
  out.poisson_ratio = poisson.value;
  out.lower_95_pa = young.lower_95;
  out.upper_95_pa = young.upper_95;
  out.poisson_lower_95 = poisson.lower_95;
  out.poisson_upper_95 = poisson.upper_95;
  out.converged = answer.termination == Termination::converged;
  out.path = answer.trace;
  return out;
}

MethodAnswer by_paper(const Prepared& given, const estimation::FitOptions& options, estimation::FitMemory* memory,
                      const OnProgress& progress, estimation::PaperDistance distance) {
  const Watch watch;
  const Identification answer = estimation::fit_as_in_paper(given.recording, given.object, given.inputs, options, progress, memory, distance);
  return summary(answer, watch.seconds());
}

MethodAnswer by_palpate(const Prepared& given, const estimation::FitOptions& options, estimation::FitMemory* memory,
                        const OnProgress& progress, Found* found) {
  const Watch watch;
  Prepared slipping = given;  // with the slips that are found
  estimation::FitOptions fit_options = options;
  const auto fit = [&](const estimation::StepCounts& steps) {
    const Prepared some = first_samples(slipping, steps);
    Identification answer = estimation::fit(some.recording, some.object, some.inputs, fit_options, progress, some.finer.get(), memory, some.doubt.get());
    if (given.doubt) given.doubt->effect = some.doubt->effect;
    return answer;
  };
  estimation::StepCounts steps = estimation::all_steps(given.recording);
  Identification answer = estimation::fit_with_slips(slipping.recording, [&](const Identification* before) {
    if (before != nullptr) {
      fit_options.young_start_pa = before->parameters[0].value;
      fit_options.poisson_start = before->parameters[1].value;
      tell_slips(slipping.recording, slipping);
    }
    return estimation::fit_within_pressure(slipping.recording, slipping.object, slipping.inputs, fit_options, fit, &steps, progress);
  });
  const MethodAnswer out = summary(answer, watch.seconds());
  if (found != nullptr) *found = {std::move(answer), std::move(steps), std::move(slipping.recording)};
  return out;
}

MethodAnswer by_palpate_told_of_slips(const Prepared& given, const Recording& slipped, const estimation::FitOptions& options,
                                      estimation::FitMemory* memory, const OnProgress& progress) {
  MethodAnswer first = by_palpate(given, options, memory, progress);
  if (says(first, contact_slipped) || !std::isfinite(first.young_modulus_pa)) return first;
  Prepared told = given;
  estimation::take_slips(slipped, told.recording);
  if (!any_slip(told.recording)) return first;  // they were in samples that are no longer there
  tell_slips(told.recording, told);
  estimation::FitOptions from_there = options;
  from_there.young_start_pa = first.young_modulus_pa;
  from_there.poisson_start = first.poisson_ratio;
  MethodAnswer out = by_palpate(told, from_there, memory, progress);
  if (!says(out, contact_slipped)) out.verdicts.emplace_back(contact_slipped);
  count_too(first, out);
  return out;
}

MethodAnswer by_palpate_on_better_shape(const Observed& seen, ModelChoice& choice, Prepared& given, const estimation::FitOptions& options,
                                        estimation::FitMemory* memory, const OnProgress& progress, Found* found) {
  const MethodAnswer first = by_palpate(given, options, memory, progress, found);
  if (!given.doubt || !given.doubt->effect || !given.doubt->effect->better) return first;
  given.doubt->effect->better.reset();
  choice.planar_agrees = true;  // the only alternative that is as likely
  given = prepare(seen, choice, nullptr, progress, given.doubt);
  MethodAnswer out = by_palpate(given, options, nullptr, progress, found);
  count_too(first, out);
  return out;
}

}  // namespace palpate::cli
