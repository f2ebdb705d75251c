// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_run.hpp"

#include <fmt/format.h>

#include <optional>

#include "cli/paper_truths.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/version.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

std::string line_of(const lab::PaperScene& scene, const TrialAnswer& trial) {
  std::string line = fmt::format("{} seed {}: ", scene.name, trial.seed);
  if (!trial.failed.empty()) line += "failed: " + trial.failed + "; ";
  if (!scene.apparent) line += fmt::format("truth {}, {:.3f}; ", report::quantity(trial.young_modulus_pa, "Pa"), trial.poisson_ratio);
  return line + fmt::format("paper's method {}, {:.3f} ({} simulations); palpate {} ({}), {:.3f} ({} solved); {:.0f} s",
                            report::quantity(trial.paper.young_modulus_pa, "Pa"), trial.paper.poisson_ratio, trial.paper.solves,
                            report::quantity(trial.palpate.young_modulus_pa, "Pa"),
                            report::interval(trial.palpate.lower_95_pa, trial.palpate.upper_95_pa, "Pa"), trial.palpate.poisson_ratio,
                            trial.palpate.load_cases, trial.total_s);
}

}  // namespace

TrialOptions options_of(const PaperPlan& plan, const lab::PaperScene& scene, std::uint64_t seed) {
  TrialOptions options;
  options.threads = plan.threads;
  if (seed != plan.details_of) return options;
  const bool dear = scene.law != "linear";
  options.samples_alone = true;
  options.pictures = true;
  options.surface_points = !plan.quick ? 25 : dear ? 5 : 9;
  return options;
}

PaperRuns run_plan(const PaperPlan& plan, const PaperWork& work, const std::filesystem::path& out) {
  const SeedFolder folder(out);
  PaperRuns runs = folder.collect();
  if (!runs.version.empty() && runs.version != version)
    throw Error(fmt::format("holds seeds of palpate {}, this is {}: answers of different programs are not joined; use another folder",
                            runs.version, version),
                out.string());
  const auto asked_of = [&](const lab::PaperScene& scene, int k) {
    const std::uint64_t seed = plan.first_seed + static_cast<std::uint64_t>(k);
    return SeedAsked{std::string(scene.name), seed, options_of(plan, scene, seed), plan.object, plan.quick};
  };
  const auto asked_of_study = [&](const Study& study, int k) {
    const std::uint64_t seed = plan.study_seed + static_cast<std::uint64_t>(k);
    return SeedAsked{std::string(study.name), seed, {.pictures = seed == plan.details_of}, {}, plan.quick};
  };
  int there = 0;
  for (const lab::PaperScene* scene : plan.scenes)
    for (int k = 0; k < plan.seeds; ++k) there += folder.has(asked_of(*scene, k));
  for (const Study* study : plan.studies)
    for (int k = 0; k < plan.study_seeds; ++k) there += folder.has(asked_of_study(*study, k));
  if (there > 0) work.say(fmt::format("{} seeds are there already: going on", there));
  const auto add = [&](const nlohmann::json& seed) {
    add_seed(runs, seed, "the seed that was just run");
    write_page(runs, out);
  };
  for (const lab::PaperScene* scene : plan.scenes) {
    // What serves one seed alone is not worth solving for over all of nu's range.
    std::optional<SharedModels> shared;
    const auto share_anew = [&] {
      shared.emplace();
      if (scene->true_law != "linear") shared->truths = lab::PressedMemory(truths_in(out / "truths"));  // others take seconds
    };
    if (plan.seeds > 1) share_anew();
    for (int k = 0; k < plan.seeds && !work.stopped(); ++k) {
      const SeedAsked asked = asked_of(*scene, k);
      if (folder.has(asked)) continue;
      TrialAnswer trial;
      try {
        work.trial(*scene, asked.seed, asked.options, shared ? &*shared : nullptr, trial);
      } catch (const std::exception& error) {
        trial.failed = error.what();
        if (shared) share_anew();  // it may be half made
      }
      if (work.stopped()) break;
      trial.seed = asked.seed;
      work.say(line_of(*scene, trial));
      add(folder.keep(asked, trial));
    }
  }
  for (const Study* study : plan.studies) {
    for (int k = 0; k < plan.study_seeds && !work.stopped(); ++k) {
      const SeedAsked asked = asked_of_study(*study, k);
      if (folder.has(asked)) continue;
      StudyAnswer answer{study, asked.seed, {}, {}, 0};
      try {
        work.study(*study, {asked.seed, plan.threads, asked.options.pictures}, answer);
      } catch (const std::exception& error) {
        answer.failed = error.what();
      }
      if (work.stopped()) break;
      work.say(fmt::format("{} seed {}: {}; {:.0f} s", study->name, answer.seed,
                           answer.failed.empty() ? fmt::format("{} rows", answer.rows.size()) : "failed: " + answer.failed, answer.seconds));
      add(folder.keep(asked, answer, plan.threads));
    }
  }
  return runs;
}

}  // namespace palpate::cli
