// SPDX-License-Identifier: Apache-2.0
// `palpate paper -o OUT`: the experiments of the founding paper in the lab, by its own method and by ours, side by side.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "cli/lab_setup.hpp"
#include "cli/number_checks.hpp"
#include "cli/paper_json.hpp"
#include "cli/paper_page.hpp"
#include "cli/paths.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

struct PaperArguments {
  std::string output;
  bool quick = false;
  int seeds = 0;  // 0 = by mode
  std::vector<std::string> scenes;
  std::string object;  // a mesh file; empty: the lab's animal
  MeshFileArguments file;
};

std::string line_of(const lab::PaperScene& scene, const TrialAnswer& trial) {
  std::string line = fmt::format("{} seed {}: ", scene.name, trial.seed);
  if (!scene.apparent) line += fmt::format("truth {}, {:.3f}; ", report::quantity(trial.young_modulus_pa, "Pa"), trial.poisson_ratio);
  return line + fmt::format("paper's method {}, {:.3f} ({} simulations); palpate {} ({}), {:.3f} ({} solved)",
                            report::quantity(trial.paper.young_modulus_pa, "Pa"), trial.paper.poisson_ratio, trial.paper.solves,
                            report::quantity(trial.palpate.young_modulus_pa, "Pa"),
                            report::interval(trial.palpate.lower_95_pa, trial.palpate.upper_95_pa, "Pa"), trial.palpate.poisson_ratio,
                            trial.palpate.load_cases);
}

int remake(Session& session, const PaperArguments& arguments) {
  std::vector<const lab::PaperScene*> scenes;
  TriMesh surface;
  lab::PaperScene own = lab::paper_scene("cow");
  const std::string own_name = fs::path(arguments.object).filename().string();
  if (!arguments.object.empty()) {
    surface = read_object(arguments.object, arguments.file);
    own.object = own_name;
    own.title = "Simulated test on a mesh of the user's";
    own.differs = "The object is the mesh file that was given, glued at its foot and pressed at its top; the pad is soft, the paper "
                  "pushed at a point.";
    own.surface = &surface;
    own.unused.reset();  // at the same place, with other forces
  }
  std::vector<const Study*> chosen_studies;
  for (const std::string& name : arguments.scenes) {
    if (const Study* study = study_of(name)) {
      chosen_studies.push_back(study);
    } else {
      scenes.push_back(&lab::paper_scene(name));
    }
  }
  if (arguments.scenes.empty()) {
    for (const lab::PaperScene& scene : lab::paper_scenes()) scenes.push_back(&scene);
    for (const Study& study : studies()) chosen_studies.push_back(&study);
  }
  if (own.surface != nullptr) {
    for (const lab::PaperScene*& scene : scenes)
      if (scene->name == own.name) scene = &own;
    if (std::find(scenes.begin(), scenes.end(), &own) == scenes.end())
      throw Error("takes the place of the cow, which is not among the scenes: add --scene cow", "--object " + arguments.object);
  }
  const int seeds = arguments.seeds > 0 ? arguments.seeds : arguments.quick ? 1 : 100;
  must_take_files(arguments.output);
  fs::create_directories(arguments.output);
  std::string command = fmt::format("palpate paper -o OUT{} --seeds {} --seed {}", arguments.quick ? " --quick" : "", seeds, session.seed);
  for (const std::string& name : arguments.scenes) command += " --scene " + name;
  if (own.surface != nullptr) command += " --object " + own_name;

  std::vector<SceneAnswers> answers;
  std::vector<StudyAnswer> study_answers;
  nlohmann::json told = {{"command", command},
                         {"threads", session.thread_count()},
                         {"scenes", nlohmann::json::array()},
                         {"studies", nlohmann::json::array()}};
  // After every seed: a run that is stopped leaves what it has.
  const auto keep = [&] {
    told["scenes"] = nlohmann::json::array();
    for (const SceneAnswers& each : answers) told["scenes"].push_back(json_of(each));
    io::write_file(fs::path(arguments.output) / "paper.json", told.dump(2) + "\n");
    io::write_file(fs::path(arguments.output) / "paper.html", paper_page(answers, study_answers, command, session.thread_count()));
  };
  for (const lab::PaperScene* scene : scenes) {
    if (Session::interrupted()) break;
    SharedModels shared;
    for (int k = 0; k < seeds && !Session::interrupted(); ++k) {
      TrialOptions options;
      options.threads = session.thread_count();
      const bool dear = scene->law != "linear";
      options.every_sample = k > 0 ? 0 : !arguments.quick ? 1 : dear ? 4 : 2;
      options.pictures = k == 0;
      options.surface_points = k > 0 ? 0 : !arguments.quick ? 25 : dear ? 5 : 9;
      const TrialAnswer trial = run_trial(*scene, session.seed + static_cast<std::uint64_t>(k), options, &shared, session.progress());
      if (Session::interrupted()) break;
      session.say(line_of(*scene, trial));
      if (k == 0) answers.push_back({scene, {}});
      answers.back().trials.push_back(trial);
      keep();
    }
  }
  for (const Study* study : chosen_studies) {
    if (Session::interrupted()) break;
    StudyAnswer answer{study, session.seed, study->run({session.seed, session.thread_count()}, session.progress())};
    if (Session::interrupted()) break;
    told["studies"].push_back(json_of(answer));
    study_answers.push_back(std::move(answer));
    keep();
  }
  if (answers.empty() && study_answers.empty()) return exit_numbers;  // stopped before anything was done
  session.say(fmt::format("written            {}", (fs::path(arguments.output) / "paper.html").string()));
  session.result(told);
  return Session::interrupted() ? exit_numbers : exit_done;
}

}  // namespace

Run verbs::paper(CLI::App& app) {
  auto arguments = std::make_shared<PaperArguments>();
  std::string scenes;
  for (const lab::PaperScene& scene : lab::paper_scenes()) scenes += fmt::format("\n{}: {}", scene.name, scene.title);
  for (const Study& study : studies()) scenes += fmt::format("\n{}: {}", study.name, study.title);
  app.add_option("-o,--output", arguments->output, "folder for paper.html and paper.json")->required();
  app.add_flag("--quick", arguments->quick, "one seed a scene and a coarse error surface: minutes a scene in place of many hours");
  app.add_option("--seeds", arguments->seeds, "seeds a scene, from --seed on (default: 100, with --quick 1)")->check(positive_number());
  app.add_option("--scene", arguments->scenes, "only this one; may be given several times" + scenes);
  app.add_option("--object", arguments->object, "a closed mesh file that takes the place of the cow (fig. 3, 4)")->check(CLI::ExistingFile);
  add_mesh_file_options(app, arguments->file);
  return [arguments](Session& session) { return remake(session, *arguments); };
}

}  // namespace palpate::cli
