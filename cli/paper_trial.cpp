// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_trial.hpp"

#include <chrono>
#include <cmath>
#include <limits>

#include "cli/paper_predictions.hpp"
#include "palpate/estimation/finer_model.hpp"
#include "palpate/estimation/paper_method.hpp"
#include "palpate/identify.hpp"

namespace palpate::cli {
namespace {

using Clock = std::chrono::steady_clock;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

MethodAnswer summary(const Identification& answer, double seconds) {
  MethodAnswer out;
  if (answer.parameters.size() < 2) {  // stopped before there was an answer
    out.young_modulus_pa = out.poisson_ratio = out.lower_95_pa = out.upper_95_pa = nan;
    return out;
  }
  const Parameter &young = answer.parameters[0], &poisson = answer.parameters[1];
  out.young_modulus_pa = young.value;
  out.poisson_ratio = poisson.value;
  out.lower_95_pa = young.lower_95;
  out.upper_95_pa = young.upper_95;
  out.solves = answer.fit.solves;
  out.iterations = answer.fit.iterations;
  out.seconds = seconds;
  out.converged = answer.termination == Termination::converged;
  out.path = answer.trace;
  for (const Verdict& verdict : answer.verdicts) out.verdicts.push_back(verdict.code);
  return out;
}

MethodAnswer by_paper(const Prepared& given, const estimation::FitOptions& options, const OnProgress& progress) {
  const auto start = Clock::now();
  const Identification answer = estimation::fit_as_in_paper(given.recording, given.object, given.inputs, options, progress);
  return summary(answer, std::chrono::duration<double>(Clock::now() - start).count());
}

MethodAnswer by_palpate(const Prepared& given, const estimation::FitOptions& options, const OnProgress& progress,
                        const estimation::FinerModel* finer = nullptr) {
  const auto start = Clock::now();
  const Identification answer = estimation::fit(given.recording, given.object, given.inputs, options, progress, finer);
  return summary(answer, std::chrono::duration<double>(Clock::now() - start).count());
}

ErrorSurface error_surface(const Prepared& given, const MethodAnswer& found, double true_young_pa, int side,
                           const estimation::FitOptions& options, const OnProgress& progress) {
  estimation::PaperError error(given.recording, given.object, given.inputs, options);
  ErrorSurface out;
  // Wide enough for the truth and for where the method ended.
  const double low = std::log(std::min(true_young_pa, found.young_modulus_pa) / 1.8),
               high = std::log(std::max(true_young_pa, found.young_modulus_pa) * 1.8);
  out.young_modulus_pa = VectorX::LinSpaced(side, low, high).array().exp();
  out.poisson_ratio = VectorX::LinSpaced(side, 0.02, 0.49);
  out.error_m2.resize(side, side);
  for (int i = 0; i < side; ++i) {
    for (int k = 0; k < side; ++k) out.error_m2(i, k) = error(out.young_modulus_pa(i), out.poisson_ratio(k));
    if (progress && !progress("error surface", (i + 1.0) / side)) break;
  }
  out.at_found_m2 = error(found.young_modulus_pa, found.poisson_ratio);
  return out;
}

void answer_samples(const Prepared& given, int every, const estimation::FitOptions& options, TrialAnswer& out, const OnProgress& progress) {
  estimation::FitOptions alone = options;
  alone.cross_checks = alone.stresses = false;
  std::size_t count = 0, done = 0;
  for (const Push& push : given.recording.pushes) count += push.steps.size();
  for (std::size_t p = 0; p < given.recording.pushes.size(); ++p) {
    const Push& push = given.recording.pushes[p];
    for (std::size_t s = 0; s < push.steps.size(); ++s) {
      if (progress && !progress("samples alone", static_cast<double>(done++) / static_cast<double>(count))) return;
      if (!loaded(push.steps[s]) || s % static_cast<std::size_t>(every) != 0) continue;
      const Load& load = push.steps[s].loads[0];
      SampleAnswer sample;
      sample.push = push.name;
      sample.force_n = load.force_n->dot(load.direction.normalized());
      sample.travel_m = nan;
      for (const auto& observation : push.steps[s].observations)
        if (const auto* travel = std::get_if<ToolTravel>(&observation)) sample.travel_m = travel->travel_m;
      // Ours may use the unloaded frame of the push as well; the paper's method has no use for it.
      sample.paper = by_paper(part_of(given, [&](std::size_t q, std::size_t t) { return q == p && t == s; }), alone, {});
      sample.palpate = by_palpate(
          part_of(given, [&](std::size_t q, std::size_t t) { return q == p && (t == s || !loaded(push.steps[t])); }), alone, {});
      out.samples.push_back(std::move(sample));
    }
  }
}

/// An object with regions: the paper's method answers for each site by its push alone, ours with all regions at once.
std::vector<double> answer_sites(const Prepared& given, const lab::PaperTrial& trial, const Identification& ours,
                                 const estimation::FitOptions& options, TrialAnswer& out, const OnProgress& progress) {
  std::vector<double> by_region;
  for (const std::string& name : given.object.region_names) {
    for (const Parameter& young : ours.parameters)
      if (young.name == "young_modulus" && young.region == name) by_region.push_back(young.value);
  }
  const Prepared one = as_one(given);
  for (std::size_t p = 0; p < given.recording.pushes.size(); ++p) {
    SiteAnswer site;
    site.site = given.recording.pushes[p].site;
    site.young_modulus_pa = trial.site_young_pa[p];
    site.paper = by_paper(part_of(one, [&](std::size_t q, std::size_t) { return q == p; }), options, progress);
    site.palpate = out.palpate;
    for (const Parameter& young : ours.parameters) {
      if (young.name != "young_modulus" || young.region != site.site) continue;
      site.palpate.young_modulus_pa = young.value;
      site.palpate.lower_95_pa = young.lower_95;
      site.palpate.upper_95_pa = young.upper_95;
    }
    out.sites.push_back(std::move(site));
  }
  return by_region;
}

}  // namespace

TrialAnswer run_trial(const lab::PaperScene& scene, std::uint64_t seed, const TrialOptions& options, const OnProgress& progress) {
  const lab::PaperTrial trial = lab::make_paper_trial(scene, seed, progress);
  TrialAnswer out;
  out.seed = seed;
  out.young_modulus_pa = trial.young_modulus_pa;
  out.poisson_ratio = trial.poisson_ratio;
  estimation::FitOptions fit;
  fit.threads = options.threads;

  const Prepared given = prepare(trial.recording, progress);
  out.tetrahedra = static_cast<Index>(given.object.mesh.tetrahedra.rows());
  const auto finer = estimation::finer_model(given.recording, given.object);
  const auto start = Clock::now();
  const Identification ours = estimation::fit(given.recording, given.object, given.inputs, fit, progress, finer ? &*finer : nullptr);
  out.palpate = summary(ours, std::chrono::duration<double>(Clock::now() - start).count());

  const Prepared one = as_one(given);
  out.paper = by_paper(one, fit, progress);
  Recording coarse = trial.recording;
  coarse.regions.clear();
  coarse.model.element = "tet4";
  coarse.model.refine = "none";
  out.paper_coarse = by_paper(prepare(std::move(coarse), progress), fit, progress);

  std::vector<double> by_region;
  if (!given.object.region_names.empty() && ours.parameters.size() > 2)
    by_region = answer_sites(given, trial, ours, fit, out, progress);
  predict_unused(given, trial, by_region, fit, out);
  if (options.every_sample > 0) answer_samples(one, options.every_sample, fit, out, progress);
  if (options.pictures && by_region.empty()) add_pictures(given, fit, out);
  if (options.pictures && !by_region.empty()) out.as_one_verdicts = by_palpate(one, fit, progress).verdicts;
  if (options.surface_points > 1 && by_region.empty() && std::isfinite(out.paper.young_modulus_pa))
    out.surface = error_surface(given, out.paper, out.young_modulus_pa, options.surface_points, fit, progress);
  return out;
}

}  // namespace palpate::cli
