// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

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

/// As many at the same time as asked for, taken in order. The first error ends the rest as soon as what runs is done.
void run_side_by_side(const std::vector<std::function<void()>>& tasks, int workers) {
  std::atomic<std::size_t> next{0};
  std::exception_ptr failed;
  std::mutex mutex;
  const auto work = [&] {
    try {
      for (std::size_t task = next++; task < tasks.size(); task = next++) tasks[task]();
    } catch (...) {
      const std::scoped_lock lock(mutex);
      if (!failed) failed = std::current_exception();
      next = tasks.size();
    }
  };
  std::vector<std::jthread> others;
  for (int k = 1; k < std::min(workers, static_cast<int>(tasks.size())); ++k) others.emplace_back(work);
  work();
  others.clear();  // waits for them
  if (failed) std::rethrow_exception(failed);
}

}  // namespace

TrialOptions options_of(const PaperPlan& plan, const lab::PaperScene& scene, std::uint64_t seed) {
  TrialOptions options;
  options.threads = plan.threads;
  options.coarse = plan.quick;
  if (seed != plan.details_of) return options;
  const bool dear = scene.law != "linear";
  options.samples_alone = !plan.quick || scene.each_sample;
  options.other_starts = !plan.quick || scene.error_drawn;
  options.pictures = true;
  options.surface_points = !plan.quick ? 25 : dear ? 5 : 7;
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
    return SeedAsked{std::string(scene.name), seed, options_of(plan, scene, seed), plan.object};
  };
  const auto asked_of_study = [&](const Study& study, int k) {
    const std::uint64_t seed = plan.study_seed + static_cast<std::uint64_t>(k);
    return SeedAsked{std::string(study.name), seed, {.pictures = seed == plan.details_of, .coarse = plan.quick}, {}};
  };
  int there = 0;
  for (const lab::PaperScene* scene : plan.scenes)
    for (int k = 0; k < plan.seeds; ++k) there += folder.has(asked_of(*scene, k));
  for (const Study* study : plan.studies)
    for (int k = 0; k < plan.study_seeds; ++k) there += folder.has(asked_of_study(*study, k));
  if (there > 0) work.say(fmt::format("{} seeds are there already: going on", there));
  std::mutex mutex;  // of `runs`, the page and what is said
  const auto add = [&](const nlohmann::json& seed, const std::string& line) {
    const std::scoped_lock lock(mutex);
    work.say(line);
    add_seed(runs, seed, "the seed that was just run");
    write_page(runs, out);
  };
  const auto run_scene = [&](const lab::PaperScene& scene) {
    // What serves one seed alone is not worth solving for over all of nu's range.
    std::optional<SharedModels> shared;
    const auto share_anew = [&] {
      shared.emplace();
      if (scene.true_law != "linear") shared->truths = lab::PressedMemory(truths_in(out / "truths"));  // others take seconds
    };
    if (plan.seeds > 1) share_anew();
    for (int k = 0; k < plan.seeds && !work.stopped(); ++k) {
      const SeedAsked asked = asked_of(scene, k);
      if (folder.has(asked)) continue;
      TrialAnswer trial;
      try {
        work.trial(scene, asked.seed, asked.options, shared ? &*shared : nullptr, trial);
      } catch (const std::exception& error) {
        trial.failed = error.what();
        if (shared) share_anew();  // it may be half made
      }
      if (work.stopped()) break;
      trial.seed = asked.seed;
      add(folder.keep(asked, trial), line_of(scene, trial));
    }
  };
  const auto run_study = [&](const Study& study) {
    for (int k = 0; k < plan.study_seeds && !work.stopped(); ++k) {
      const SeedAsked asked = asked_of_study(study, k);
      if (folder.has(asked)) continue;
      StudyAnswer answer{&study, asked.seed, {}, {}, 0};
      try {
        work.study(study, {asked.seed, plan.threads, asked.options.pictures, asked.options.coarse}, answer);
      } catch (const std::exception& error) {
        answer.failed = error.what();
      }
      if (work.stopped()) break;
      add(folder.keep(asked, answer, plan.threads),
          fmt::format("{} seed {}: {}; {:.0f} s", study.name, answer.seed,
                      answer.failed.empty() ? fmt::format("{} rows", answer.rows.size()) : "failed: " + answer.failed, answer.seconds));
    }
  };
  std::vector<std::function<void()>> tasks;
  for (const lab::PaperScene* scene : plan.scenes) tasks.emplace_back([&run_scene, scene] { run_scene(*scene); });
  for (const Study* study : plan.studies) tasks.emplace_back([&run_study, study] { run_study(*study); });
  run_side_by_side(tasks, plan.side_by_side);
  return runs;
}

}  // namespace palpate::cli
