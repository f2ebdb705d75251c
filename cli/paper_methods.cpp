// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_methods.hpp"

#include <limits>

#include "palpate/estimation/paper_method.hpp"
#include "palpate/estimation/slips.hpp"

namespace palpate::cli {
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
                        const OnProgress& progress, Identification* whole, estimation::StepCounts* fitted) {
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
      if (slipping.finer) {
        slipping.finer = std::make_shared<estimation::FinerModel>(*slipping.finer);
        estimation::take_slips(slipping.recording, slipping.finer->recording);
      }
      if (slipping.doubt) {
        slipping.doubt = std::make_shared<estimation::ShapeDoubt>(*slipping.doubt);
        slipping.doubt->effect.reset();
        for (estimation::AlternativeShape& shape : slipping.doubt->shapes) estimation::take_slips(slipping.recording, shape.recording);
      }
    }
    return estimation::fit_within_pressure(slipping.recording, slipping.object, slipping.inputs, fit_options, fit, &steps, progress);
  });
  if (fitted != nullptr) *fitted = steps;
  const MethodAnswer out = summary(answer, watch.seconds());
  if (whole != nullptr) *whole = std::move(answer);
  return out;
}

MethodAnswer by_palpate_on_better_shape(const Recording& recording, ModelChoice& choice, Prepared& given, const estimation::FitOptions& options,
                                        estimation::FitMemory* memory, const OnProgress& progress, Identification* whole,
                                        estimation::StepCounts* fitted) {
  const MethodAnswer first = by_palpate(given, options, memory, progress, whole, fitted);
  if (!given.doubt || !given.doubt->effect || !given.doubt->effect->better) return first;
  given.doubt->effect->better.reset();
  choice.planar_agrees = true;  // the only alternative that is as likely
  given = prepare(recording, choice, nullptr, progress, given.doubt);
  MethodAnswer out = by_palpate(given, options, nullptr, progress, whole, fitted);
  out.solves += first.solves;
  out.load_cases += first.load_cases;
  out.iterations += first.iterations;
  out.seconds += first.seconds;
  return out;
}

}  // namespace palpate::cli
