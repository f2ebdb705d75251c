// SPDX-License-Identifier: Apache-2.0
// `palpate paper -o OUT`: the experiments of the founding paper in the lab, by its own method and by ours, side by side.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "cli/lab_setup.hpp"
#include "cli/number_checks.hpp"
#include "cli/paper_run.hpp"
#include "cli/paths.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

struct PaperArguments {
  std::string output;
  bool quick = false;
  int seeds = 0;  // 0 = by mode
  std::uint64_t details_of = 1;
  std::vector<std::string> scenes, from;
  std::string object;  // a mesh file; empty: the lab's animal
  MeshFileArguments file;
};

int done(Session& session, const PaperRuns& runs, const std::string& output) {
  if (runs.scenes.empty() && runs.studies.empty()) return exit_numbers;  // stopped before anything was done
  const nlohmann::json told = write_page(runs, output);
  session.say(fmt::format("written            {}", (fs::path(output) / "paper.html").string()));
  session.result(told);
  return Session::interrupted() ? exit_numbers : exit_done;
}

int join(Session& session, const PaperArguments& arguments) {
  must_take_files(arguments.output);
  const SeedFolder folder(arguments.output);
  for (const std::string& from : arguments.from)
    if (!fs::exists(arguments.output) || !fs::exists(from) || !fs::equivalent(from, arguments.output)) folder.take_from(from);
  return done(session, folder.collect(), arguments.output);
}

/// @throws Error naming all there are.
const lab::PaperScene& scene_of(const std::string& name) {
  std::string names;
  for (const lab::PaperScene& scene : lab::paper_scenes()) {
    if (scene.name == name) return scene;
    names += fmt::format("{}, ", scene.name);
  }
  for (const Study& study : studies()) names += fmt::format("{}{}", study.name, &study == &studies().back() ? "" : ", ");
  throw Error("is no scene or study of the paper; there are: " + names, "--scene " + name);
}

/// What each stands for is in the tables; without names: all.
void choose(const PaperArguments& arguments, std::uint64_t seed, PaperPlan& plan) {
  plan.study_seed = seed;
  plan.study_seeds = std::max(arguments.seeds, 1);  // of those that are named: many only when asked for
  for (const std::string& name : arguments.scenes) {
    if (const Study* study = study_of(name)) {
      plan.studies.push_back(study);
    } else {
      plan.scenes.push_back(&scene_of(name));
    }
  }
  if (!arguments.scenes.empty()) return;
  for (const lab::PaperScene& scene : lab::paper_scenes()) plan.scenes.push_back(&scene);
  // Once, and not in every piece of a run.
  if (plan.details_of < seed || plan.details_of - seed >= static_cast<std::uint64_t>(plan.seeds)) return;
  plan.study_seed = plan.details_of;
  plan.study_seeds = 1;
  for (const Study& study : studies()) plan.studies.push_back(&study);
}

int remake(Session& session, const PaperArguments& arguments) {
  if (!arguments.from.empty()) return join(session, arguments);
  PaperPlan plan;
  plan.first_seed = session.seed;
  plan.seeds = arguments.seeds > 0 ? arguments.seeds : arguments.quick ? 1 : 100;
  plan.details_of = arguments.details_of;
  plan.quick = arguments.quick;
  choose(arguments, session.seed, plan);
  // A thread a scene does more than all of them on one.
  const int tasks = static_cast<int>(plan.scenes.size() + plan.studies.size()), threads = session.thread_count();
  plan.side_by_side = std::clamp(tasks, 1, threads);
  plan.threads = threads / plan.side_by_side;
  TriMesh surface;
  lab::PaperScene own;
  if (!arguments.object.empty()) {
    surface = read_object(arguments.object, arguments.file);
    plan.object = {fs::path(arguments.object).filename().string(), io::sha256_hex(io::read_file(arguments.object)), arguments.file.up,
                   arguments.file.size_m};
    own = in_the_cows_place(plan.object.name, &surface);
    lab::object_from_surface(surface, plan.object.name, {});  // that it is one is said before anything is run
    const auto cow = std::find_if(plan.scenes.begin(), plan.scenes.end(), [&](const auto* scene) { return scene->name == own.name; });
    if (cow == plan.scenes.end())
      throw Error("takes the place of the cow, which is not among the scenes: add --scene cow", "--object " + arguments.object);
    *cow = &own;
  }
  must_take_files(arguments.output);
  // Stages of several scenes at once would read like one that jumps.
  const bool alone = plan.side_by_side == 1;
  if (!alone) session.say(fmt::format("{} experiments, {} at a time; a line when one is done", tasks, plan.side_by_side));
  const auto progress = [&]() -> OnProgress {
    if (alone) return session.progress();
    return [](std::string_view, double) { return !Session::interrupted(); };
  };
  PaperWork work;
  work.trial = [&](const lab::PaperScene& scene, std::uint64_t seed, const TrialOptions& options, SharedModels* shared, TrialAnswer& out) {
    run_trial(scene, seed, options, shared, progress(), out);
  };
  work.study = [&](const Study& study, const StudyOptions& options, StudyAnswer& out) {
    const Watch watch;
    out.rows = study.run(options, progress());
    out.seconds = watch.seconds();
  };
  work.stopped = [] { return Session::interrupted(); };
  work.say = [&](const std::string& line) { session.say(line); };
  return done(session, run_plan(plan, work, arguments.output), arguments.output);
}

}  // namespace

Run verbs::paper(CLI::App& app) {
  auto arguments = std::make_shared<PaperArguments>();
  std::string scenes;
  for (const lab::PaperScene& scene : lab::paper_scenes()) scenes += fmt::format("\n{}: {}", scene.name, scene.title);
  for (const Study& study : studies()) scenes += fmt::format("\n{}: {}", study.name, study.title);
  app.add_option("-o,--output", arguments->output, "folder for paper.html, paper.json and seeds/, a file a seed; a run that was stopped goes on from these")->required();
  app.add_flag("--quick", arguments->quick, "a look: one seed a scene, on a mesh of about 800 tetrahedra that nobody refines, with a third of the points and four samples a push; samples alone and other starts only where the paper has them. A quarter of an hour on two cores in place of many hours");
  app.add_option("--seeds", arguments->seeds, "seeds a scene, from --seed on (default: 100, with --quick 1; of a study that --scene names: 1)")->check(positive_number());
  app.add_option("--details-of", arguments->details_of,
                 "the seed of each scene that also gets pictures, samples alone, the grid search and cross-checks (0: none)")
      ->capture_default_str();
  app.add_option("--from", arguments->from,
                 "folders that were written with -o, by runs of other --seed or --scene say: nothing is run, their seeds are put together in "
                 "OUTPUT and the page made of all")
      ->excludes("--seeds")
      ->excludes("--quick");
  app.add_option("--scene", arguments->scenes, "only this one; may be given several times" + scenes);
  app.add_option("--object", arguments->object, "a closed mesh file that takes the place of the cow (fig. 3, 4)")->check(CLI::ExistingFile);
  add_mesh_file_options(app, arguments->file);
  return [arguments](Session& session) { return remake(session, *arguments); };
}

}  // namespace palpate::cli
