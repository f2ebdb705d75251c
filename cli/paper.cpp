// SPDX-License-Identifier: Apache-2.0
// `palpate paper -o OUT`: the experiments of the founding paper in the lab, by its own method and by ours, side by side.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <memory>

#include "cli/paper_page.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

struct PaperArguments {
  std::string output;
  bool quick = false;
  int seeds = 0;  // 0 = by mode
  std::vector<std::string> scenes;
};

nlohmann::json json_of(const MethodAnswer& answer) {
  return {{"young_modulus_pa", answer.young_modulus_pa}, {"lower_95_pa", answer.lower_95_pa}, {"upper_95_pa", answer.upper_95_pa},
          {"poisson_ratio", answer.poisson_ratio},       {"solves", answer.solves},           {"iterations", answer.iterations},
          {"seconds", answer.seconds},                   {"converged", answer.converged},     {"verdicts", answer.verdicts}};
}

nlohmann::json json_of(const TrialAnswer& trial) {
  nlohmann::json out = {{"seed", trial.seed},
                        {"true_young_modulus_pa", trial.young_modulus_pa},
                        {"true_poisson_ratio", trial.poisson_ratio},
                        {"tetrahedra", trial.tetrahedra},
                        {"paper", json_of(trial.paper)},
                        {"paper_linear_tetrahedra", json_of(trial.paper_coarse)},
                        {"palpate", json_of(trial.palpate)}};
  for (const SiteAnswer& site : trial.sites)
    out["sites"].push_back({{"site", site.site},
                            {"true_young_modulus_pa", site.young_modulus_pa},
                            {"paper", json_of(site.paper)},
                            {"palpate", json_of(site.palpate)}});
  if (!trial.as_one_verdicts.empty()) out["verdicts_without_regions"] = trial.as_one_verdicts;
  for (const UnusedStep& step : trial.unused)
    out["unused_place"].push_back({{"force_n", step.force_n},
                                   {"travel_m", step.travel_m},
                                   {"force_paper_n", step.force_paper_n},
                                   {"force_palpate_n", step.force_palpate_n},
                                   {"surface_rms_m",
                                    {{"paper", step.surface_paper_m}, {"palpate", step.surface_palpate_m}, {"still", step.surface_still_m}}}});
  for (const RegistrationPicture& picture : trial.pictures)
    out["registrations"].push_back({{"young_modulus_pa", picture.young_modulus_pa}, {"rms_m", picture.rms_m}});
  for (const SampleAnswer& sample : trial.samples)
    out["samples"].push_back({{"push", sample.push},
                              {"force_n", sample.force_n},
                              {"travel_m", sample.travel_m},
                              {"paper", json_of(sample.paper)},
                              {"palpate", json_of(sample.palpate)}});
  if (trial.surface.error_m2.size() > 0)
    out["grid_search"] = {{"smallest_m2", trial.surface.smallest_m2()}, {"at_found_m2", trial.surface.at_found_m2}};
  return out;
}

nlohmann::json json_of(const Score& score) {
  return {{"bias_percent", score.bias_percent}, {"rms_percent", score.rms_percent}, {"poisson_bias", score.poisson_bias},
          {"poisson_rms", score.poisson_rms},   {"inside_95", score.inside_95},     {"with_interval", score.with_interval},
          {"solves", score.solves},             {"seconds", score.seconds}};
}

void write(const fs::path& path, const std::string& text) {
  const fs::path aside = path.string() + ".part";
  std::ofstream file(aside, std::ios::binary);
  file << text;
  file.close();
  if (!file) throw Error("cannot be written; is the disk full?", path.string());
  fs::rename(aside, path);
}

int remake(Session& session, const PaperArguments& arguments) {
  std::vector<const lab::PaperScene*> chosen;
  for (const std::string& name : arguments.scenes) chosen.push_back(&lab::paper_scene(name));
  if (chosen.empty())
    for (const lab::PaperScene& scene : lab::paper_scenes()) chosen.push_back(&scene);
  const int seeds = arguments.seeds > 0 ? arguments.seeds : arguments.quick ? 1 : 100;
  fs::create_directories(arguments.output);
  std::string command = fmt::format("palpate paper -o OUT{} --seeds {} --seed {}", arguments.quick ? " --quick" : "", seeds, session.seed);
  for (const std::string& name : arguments.scenes) command += " --scene " + name;

  std::vector<SceneAnswers> answers;
  nlohmann::json told = {{"command", command}, {"threads", session.thread_count()}, {"scenes", nlohmann::json::array()}};
  for (const lab::PaperScene* scene : chosen) {
    SceneAnswers of_scene{scene, {}};
    for (int k = 0; k < seeds && !Session::interrupted(); ++k) {
      TrialOptions options;
      options.threads = session.thread_count();
      options.every_sample = k > 0 ? 0 : arguments.quick ? 2 : 1;
      options.pictures = k == 0;
      options.surface_points = k > 0 ? 0 : arguments.quick ? 9 : 25;
      const TrialAnswer trial = run_trial(*scene, session.seed + static_cast<std::uint64_t>(k), options, session.progress());
      if (Session::interrupted()) break;
      session.say(fmt::format("{} seed {}: truth {}, {:.3f}; paper's method {}, {:.3f} ({} solves); palpate {} ({}), {:.3f} ({} solves)",
                              scene->name, trial.seed, report::quantity(trial.young_modulus_pa, "Pa"), trial.poisson_ratio,
                              report::quantity(trial.paper.young_modulus_pa, "Pa"), trial.paper.poisson_ratio, trial.paper.solves,
                              report::quantity(trial.palpate.young_modulus_pa, "Pa"),
                              report::interval(trial.palpate.lower_95_pa, trial.palpate.upper_95_pa, "Pa"),
                              trial.palpate.poisson_ratio, trial.palpate.solves));
      of_scene.trials.push_back(trial);
    }
    if (of_scene.trials.empty()) break;
    nlohmann::json json = {{"scene", scene->name}, {"trials", nlohmann::json::array()}};
    for (const TrialAnswer& trial : of_scene.trials) json["trials"].push_back(json_of(trial));
    const SceneScores scores = scores_of(of_scene.trials);
    json["scores"] = {{"paper", json_of(scores.paper)},
                      {"paper_linear_tetrahedra", json_of(scores.paper_coarse)},
                      {"palpate", json_of(scores.palpate)}};
    told["scenes"].push_back(std::move(json));
    answers.push_back(std::move(of_scene));
    // After every scene: a run that is stopped leaves what it has.
    write(fs::path(arguments.output) / "paper.json", told.dump(2) + "\n");
    write(fs::path(arguments.output) / "paper.html", paper_page(answers, command, session.thread_count()));
  }
  session.say(fmt::format("written            {}", (fs::path(arguments.output) / "paper.html").string()));
  session.result(told);
  return Session::interrupted() ? exit_numbers : exit_done;
}

}  // namespace

Run verbs::paper(CLI::App& app) {
  auto arguments = std::make_shared<PaperArguments>();
  std::string scenes;
  for (const lab::PaperScene& scene : lab::paper_scenes()) scenes += fmt::format("\n{}: {}", scene.name, scene.title);
  app.add_option("-o,--output", arguments->output, "folder for paper.html and paper.json")->required();
  app.add_flag("--quick", arguments->quick, "one seed a scene and a coarse error surface: minutes in place of many hours");
  app.add_option("--seeds", arguments->seeds, "seeds a scene, from --seed on (default: 100, with --quick 1)")->check(CLI::PositiveNumber);
  app.add_option("--scene", arguments->scenes, "only this one; may be given several times" + scenes);
  return [arguments](Session& session) { return remake(session, *arguments); };
}

}  // namespace palpate::cli
