// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_trial.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "cli/paper_predictions.hpp"
#include "cli/paper_views.hpp"
#include "palpate/core/error.hpp"
#include "palpate/estimation/paper_method.hpp"

namespace palpate::cli {
namespace {

/// Every (E, nu) takes as many searches for equilibrium as there are samples.
bool dear(const Prepared& given) { return given.object.material != "linear"; }

int samples(const Recording& recording) {
  int count = 0;
  for (const Push& push : recording.pushes) count += static_cast<int>(std::count_if(push.steps.begin(), push.steps.end(), loaded));
  return count;
}

/// Says what its life took, also where an error ends it.
class Takes {
 public:
  explicit Takes(double& seconds) : seconds_(seconds) {}
  ~Takes() { seconds_ = watch_.seconds(); }
  Takes(const Takes&) = delete;
  Takes& operator=(const Takes&) = delete;

 private:
  Watch watch_;
  double& seconds_;
};

template <class Ask>
MethodAnswer asked(Ask ask) {
  try {
    return ask();
  } catch (const Error& error) {
    MethodAnswer none = no_answer();
    none.failed = error.what();
    return none;
  }
}

ErrorSurface error_surface(const Prepared& given, const MethodAnswer& found, double other_young_pa, int side,
                           const estimation::FitOptions& options, const OnProgress& progress) {
  estimation::PaperError error(given.recording, given.object, given.inputs, options);
  ErrorSurface out;
  // Wide enough for the truth (or the other method's answer) and for where the method ended.
  if (!std::isfinite(other_young_pa)) other_young_pa = found.young_modulus_pa;
  const double low = std::log(std::min(other_young_pa, found.young_modulus_pa) / 1.8),
               high = std::log(std::max(other_young_pa, found.young_modulus_pa) * 1.8);
  out.young_modulus_pa = VectorX::LinSpaced(side, low, high).array().exp();
  out.poisson_ratio = dear(given) ? VectorX::Constant(1, found.poisson_ratio) : VectorX(VectorX::LinSpaced(side, 0.02, 0.49));
  out.error_m2.resize(side, out.poisson_ratio.size());
  for (int i = 0; i < side; ++i) {
    for (Index k = 0; k < static_cast<Index>(out.poisson_ratio.size()); ++k) out.error_m2(i, k) = error(out.young_modulus_pa(i), out.poisson_ratio(k));
    if (progress && !progress("error surface", (i + 1.0) / side)) break;
  }
  out.at_found_m2 = error(found.young_modulus_pa, found.poisson_ratio);
  return out;
}

void answer_samples(const Prepared& given, const estimation::FitOptions& options, TrialAnswer& out, const OnProgress& progress) {
  estimation::FitOptions alone = options;
  alone.cross_checks = alone.stresses = alone.find_slips = false;  // of one sample there is no slip
  std::size_t count = 0, done = 0;
  for (const Push& push : given.recording.pushes) count += push.steps.size();
  for (std::size_t p = 0; p < given.recording.pushes.size(); ++p) {
    const Push& push = given.recording.pushes[p];
    estimation::FitMemory of_paper, of_palpate;  // what is solved for at one contact serves all its samples
    for (std::size_t s = 0; s < push.steps.size(); ++s) {
      if (progress && !progress("samples alone", static_cast<double>(done++) / static_cast<double>(count))) return;
      if (!loaded(push.steps[s])) continue;
      const Load& load = push.steps[s].loads[0];
      SampleAnswer sample;
      sample.push = push.name;
      sample.force_n = load.force_n->dot(load.direction.normalized());
      sample.travel_m = travel_of(push.steps[s]);
      // Ours may use the unloaded frame of the push as well; the paper's method has no use for it.
      const Prepared loaded_alone = part_of(given, [&](std::size_t q, std::size_t t) { return q == p && t == s; }),
                     with_unloaded = part_of(given, [&](std::size_t q, std::size_t t) { return q == p && (t == s || !loaded(push.steps[t])); });
      sample.paper = asked([&] { return by_paper(loaded_alone, alone, &of_paper, {}); });
      sample.palpate = asked([&] { return by_palpate(with_unloaded, alone, &of_palpate, {}); });
      out.samples.push_back(std::move(sample));
    }
  }
}

/// An object with regions: the paper's method answers for each site by its push alone, ours with all regions at once.
std::vector<double> answer_sites(const Prepared& given, const lab::PaperTrial& trial, const Identification& ours,
                                 const estimation::FitOptions& options, SharedModels& shared, TrialAnswer& out, const OnProgress& progress) {
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
    site.paper = asked([&] {
      return by_paper(part_of(one, [&](std::size_t q, std::size_t) { return q == p; }), options, &shared.sites[site.site], progress);
    });
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

/// Far off to either side, and from the lowest point of the grid: a method that reaches the minimum of its own objective comes to where it
/// came to before.
/// @param only_grids_lowest  from there alone
/// @param mine  of palpate's fits; nullptr: of use to this seed alone, which three starts do not make worth all of nu's range
void answer_starts(const Prepared& given, const estimation::FitOptions& options, SharedModels& shared, estimation::FitMemory* mine, bool only_grids_lowest,
                   TrialAnswer& out, const OnProgress& progress) {
  Eigen::Index row = 0, column = 0;
  out.surface.error_m2.minCoeff(&row, &column);
  const double young_pa = std::isfinite(out.young_modulus_pa) ? out.young_modulus_pa : out.palpate.young_modulus_pa;
  const std::pair<double, double> starts[] = {
      {0.2 * young_pa, 0.1}, {5 * young_pa, 0.45}, {out.surface.young_modulus_pa(row), out.surface.poisson_ratio(column)}};
  for (const auto& [start_pa, start_nu] : std::span(starts).last(only_grids_lowest ? 1 : std::size(starts))) {
    estimation::FitOptions there = options;
    there.young_start_pa = start_pa;
    there.poisson_start = start_nu;
    StartAnswer& from = out.starts.emplace_back();
    from.young_modulus_pa = start_pa, from.poisson_ratio = start_nu;
    from.paper = asked([&] { return by_paper(given, there, &shared.fine.paper, progress); });
    from.palpate = asked([&] { return by_palpate(given, there, mine, progress); });
  }
}

/// They are drawn on the error surface alone, and are half of what a seed's file would hold.
void drop_paths(TrialAnswer& out) {
  for (MethodAnswer* answer : {&out.paper, &out.palpate, &out.paper_coarse, &out.other}) answer->path.clear();
  for (SiteAnswer& site : out.sites) {
    site.paper.path.clear();
    site.palpate.path.clear();
  }
}

}  // namespace

void run_trial(const lab::PaperScene& whole, std::uint64_t seed, const TrialOptions& options, SharedModels* shared,
               const OnProgress& progress, TrialAnswer& out) {
  const lab::PaperScene scene = options.coarse ? for_a_look(whole) : whole;
  const Takes all(out.total_s);
  const Watch truth;
  lab::PaperTrial trial = lab::make_paper_trial(scene, seed, progress, {}, shared != nullptr ? &shared->truths : nullptr);
  out.truth_s = truth.seconds();
  SharedModels of_this_seed;
  const bool same_mesh = trial.recording.rest.views.empty();  // in all seeds
  // What is of no use to another seed need not be solved for over all of nu's range.
  const bool keeps = shared != nullptr && same_mesh;
  if (!keeps) shared = &of_this_seed;
  estimation::FitMemory *const mine = keeps ? &shared->fine.palpate : nullptr, *const others = keeps ? &shared->other.palpate : nullptr;
  out.seed = seed;
  out.unused_stop = trial.unused_stop;
  if (!scene.apparent) {
    out.young_modulus_pa = trial.young_modulus_pa;
    out.poisson_ratio = trial.poisson_ratio;
  }
  for (const Push& push : trial.recording.pushes)
    for (const Step& step : push.steps)
      if (loaded(step)) out.readings.push_back({push.name, step.loads[0].force_n->norm(), travel_of(step)});
  estimation::FitOptions fit;
  fit.threads = options.threads;
  fit.cross_checks = fit.stresses = false;  // the paper's method has none: neither side's solves count them
  fit.find_slips = true;                    // changes the answer, and counts

  ModelChoice choice = choice_of(scene, options.coarse);
  const Watch model;
  Observed seen = observed(trial.recording);
  Prepared given = prepare(seen, choice, &shared->fine, progress);
  out.model_s = model.seconds();
  Found ours;
  ours.fitted = estimation::all_steps(given.recording);
  out.palpate = asked([&] { return by_palpate_on_better_shape(seen, choice, given, fit, mine, progress, &ours); });
  // From here on these samples alone, by both methods.
  seen.inputs = estimation::first_steps(seen.inputs, seen.recording, ours.fitted);
  estimation::keep_first_steps(seen.recording, ours.fitted);
  out.left_out = samples(given.recording);
  given = first_samples(std::move(given), ours.fitted);
  out.left_out -= samples(given.recording);
  out.tetrahedra = static_cast<Index>(given.object.mesh.tetrahedra.rows());
  const Prepared one = as_one(given);
  out.paper = asked([&] { return by_paper(one, fit, &shared->fine.paper, progress); });
  // Sites are compared one by one, and not on those.
  if (options.pictures && !dear(given) && given.object.region_names.empty()) {
    choice.linear = true;
    out.paper_coarse = asked([&] { return by_paper(prepare(seen, choice, &shared->linear, progress), fit, &shared->linear.paper, progress); });
  }
  std::optional<Prepared> other;
  if (!scene.other_law.empty()) {
    other = with_law(given, scene.other_law);
    out.other_law = scene.other_law;
    out.other = asked([&] { return by_palpate_told_of_slips(*other, ours.slipped, fit, others, progress); });
  }

  std::vector<double> by_region;
  if (!given.object.region_names.empty() && ours.answer.parameters.size() > 2)
    by_region = answer_sites(given, trial, ours.answer, fit, *shared, out, progress);
  predict_unused(given, other ? &*other : nullptr, trial, by_region, fit, *shared, out);
  if (options.samples_alone) answer_samples(one, fit, out, progress);
  if (options.pictures && by_region.empty()) {
    const bool known = !scene.apparent;  // else around what was found
    add_pictures(given, known ? out.young_modulus_pa : out.palpate.young_modulus_pa,
                 known ? out.poisson_ratio : out.palpate.poisson_ratio, fit, out);
  }
  if (options.pictures) {
    out.views = views_of(seen.recording, given, out.palpate, by_region, fit);
    estimation::FitOptions checked = fit;
    checked.cross_checks = true;
    const auto judged = [&](const Prepared& what, const Recording& slipped, MethodAnswer& answer, estimation::FitMemory* memory) {
      if (!answer.converged) return;
      estimation::FitOptions from_there = checked;
      from_there.young_start_pa = answer.young_modulus_pa;
      from_there.poisson_start = answer.poisson_ratio;
      from_there.start_is_answer = true;
      const bool left_out = std::find(answer.verdicts.begin(), answer.verdicts.end(), "deep_loads_left_out") != answer.verdicts.end();
      answer.verdicts = by_palpate_told_of_slips(what, slipped, from_there, memory, progress).verdicts;
      if (left_out) answer.verdicts.emplace_back("deep_loads_left_out");  // of samples that are no longer there
    };
    judged(given, given.recording, out.palpate, mine);
    if (other) judged(*other, ours.slipped, out.other, others);
    if (!by_region.empty()) out.as_one_verdicts = by_palpate(one, checked, nullptr, progress).verdicts;
  }
  if (options.surface_points > 1 && by_region.empty() && std::isfinite(out.paper.young_modulus_pa))
    out.surface = error_surface(given, out.paper, scene.apparent ? out.palpate.young_modulus_pa : out.young_modulus_pa, options.surface_points, fit, progress);
  // Of a shape that is a guess palpate asks a dozen more: minutes a start, and nothing about starts.
  const bool guessed = given.doubt && !given.doubt->shapes.empty();
  if (options.other_starts && out.surface.error_m2.cols() > 1 && !guessed) answer_starts(given, fit, *shared, mine, options.coarse, out, progress);
  if (out.surface.error_m2.size() == 0) drop_paths(out);
}

}  // namespace palpate::cli
