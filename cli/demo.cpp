// SPDX-License-Identifier: Apache-2.0
// `palpate demo -o OUT`: the whole way on the built-in recording, verb by verb as a user would type it, with the truth
// beside the answer at the end.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "cli/demo_mark.hpp"
#include "cli/paths.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/lab/built_in.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

int run_verb(SetUp& set_up, const std::string& name, const std::vector<std::string>& arguments, Session& session) {
  std::string typed = "$ palpate " + name;
  for (const std::string& argument : arguments) typed += " " + argument;
  session.say(typed);
  CLI::App app;
  const Run run = set_up(app);
  app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  return run(session);
}

nlohmann::json read_json(const fs::path& path) {
  std::ifstream file(path);
  nlohmann::json object = nlohmann::json::parse(file, nullptr, false);
  if (object.is_discarded()) throw Error("cannot be read back", path.string());
  return object;
}

/// "Young's modulus: truth 20.0 kPa, found 20.3 kPa, inside the 95 % interval", one line a parameter.
void compare_with_truth(Session& session, const nlohmann::json& truth, const nlohmann::json& result) {
  session.say("The recording was made by palpate's own lab, so the truth is known:");
  for (const auto& parameter : result.at("parameters")) {
    const std::string name = parameter.at("name"), unit = parameter.value("unit", "");
    const std::string key = name == "young_modulus" ? "young_modulus_pa" : name;
    if (!truth.contains(key)) continue;
    const double true_value = truth.at(key), value = parameter.at("value");
    const double lower = parameter.at("lower_95"), upper = parameter.at("upper_95");
    const bool inside = lower <= true_value && true_value <= upper;
    session.say(fmt::format("  {}: truth {}, found {}, {} the 95 % interval {}",
                            name == "young_modulus" ? "Young's modulus" : "Poisson ratio",
                            report::quantity(true_value, unit), report::quantity(value, unit), inside ? "inside" : "OUTSIDE",
                            report::interval(lower, upper, unit)));
  }
}

/// A prediction is for a push that has not been made: elsewhere than those of the recording, and with another force. The lab makes
/// it afterwards.
int predict_and_compare(Session& quiet_json, Session& session, const fs::path& out, const nlohmann::json& truth) {
  constexpr double site_m = 0.005;  // those of the recording are at -20 and 30 mm
  const std::vector<double> forces_n = truth.at("force_n").at(0);
  const double force_n = 0.5 * (forces_n.at(forces_n.size() / 2) + forces_n.at(forces_n.size() / 2 + 1));
  const lab::DemoPush made = lab::demo_push({}, truth.at("young_modulus_pa"), truth.at("poisson_ratio"), site_m, force_n);
  const fs::path folder = out / "prediction";
  std::vector<std::string> words{out.string(), "--contact"};
  for (const double at_m : made.contact_m) words.push_back(fmt::format("{:g}", at_m));
  for (const std::string& word : {std::string("--force"), fmt::format("{:g}", force_n), std::string("-o"), folder.string()}) words.push_back(word);
  const int code = run_verb(verbs::predict, "predict", words, quiet_json);
  if (code != exit_done) return code;
  const nlohmann::json band = read_json(folder / "prediction.json").at("travel_m");
  const double lower_m = band.at("lower_95"), upper_m = band.at("upper_95");
  session.say(fmt::format("A push that the fit has not seen, at {:g} mm and {} (those seen: -20 and 30 mm): predicted {}, true {}, {} the 95 % band {}",
                          1000 * site_m, report::quantity(force_n, "N"), report::quantity(band.at("value"), "m"),
                          report::quantity(made.travel_m, "m"), lower_m <= made.travel_m && made.travel_m <= upper_m ? "inside" : "OUTSIDE",
                          report::interval(lower_m, upper_m, "m")));
  return exit_done;
}

int demonstrate(Session& session, fs::path out) {
  if (out.string().starts_with('-')) out = "." / out;  // the verbs below would take it for an option
  const fs::path recording = out / "recording", truth = out / "truth.json";
  must_take_files(out);
  must_take_demo(out);
  fs::create_directories(out);
  fs::remove_all(recording);  // an earlier demonstration's, file by file
  fs::remove(truth);
  mark_demo(out);
  Session quiet_json;  // the demonstration answers with one object: that of the estimate
  quiet_json.seed = session.seed;
  quiet_json.threads = session.threads;
  quiet_json.quiet = session.quiet;
  int code = run_verb(verbs::record, "record", {"--demo", "-o", recording.string(), "--truth", truth.string()}, quiet_json);
  if (code != exit_done) return code;
  mark_demo(out);
  code = run_verb(verbs::estimate, "estimate", {recording.string(), "-o", out.string()}, session);
  if (!fs::exists(out / "result.json")) return code;
  const nlohmann::json known = read_json(truth);
  compare_with_truth(session, known, read_json(out / "result.json"));
  const int predicted = predict_and_compare(quiet_json, session, out, known);
  if (code == exit_done) code = predicted;
  const int drawn = run_verb(verbs::report, "report", {out.string(), "--png", (out / "figures").string()}, quiet_json);
  return code != exit_done ? code : drawn;
}

}  // namespace

Run verbs::demo(CLI::App& app) {
  auto out = std::make_shared<std::string>("palpate-demo");
  app.add_option("-o,--out", *out, "folder for the recording, the result, the report and the figures: new, empty, or of an earlier demo")
      ->capture_default_str();
  return [out](Session& session) { return demonstrate(session, *out); };
}

}  // namespace palpate::cli
