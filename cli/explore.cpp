// SPDX-License-Identifier: Apache-2.0
// `palpate explore -o OUT`: the lab's robot, or a driver's, pushes, estimates and chooses the next best push until E and nu are known as
// well as was asked for. OUT/recording grows step by step; result, model and report come at the end.
#include "palpate/explore.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "cli/live_report.hpp"
#include "cli/material_names.hpp"
#include "cli/new_folder.hpp"
#include "cli/number_checks.hpp"
#include "cli/paths.hpp"
#include "cli/push_options.hpp"
#include "cli/push_robot.hpp"
#include "cli/push_words.hpp"
#include "cli/truth_file.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/io/result.hpp"
#include "palpate/report/report.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
  RobotArguments robot;
  ExploreOptions explore;
  fs::path out;
  std::string goal = "both", law, refine;
  bool compare = false;
  LiveOptions live;
};

nlohmann::json moduli_json(const std::vector<Parameter>& young) {
  if (young.size() == 1) return young.front().value;
  nlohmann::json regions;
  for (const Parameter& one : young) regions[one.region] = one.value;
  return regions;
}

std::string moduli_words(const std::vector<Parameter>& young) {
  std::string words;
  for (const Parameter& one : young)
    words += fmt::format("{}{}{}{}", words.empty() ? "" : ", ", one.region, one.region.empty() ? "" : " ",
                         report::quantity(one.value, "Pa"));
  return words;
}

nlohmann::json json_of(const ExploredPush& push) {
  const auto& at = push.plan.candidate;
  return {{"push", push.name},
          {"contact_m", {at.contact_m.x(), at.contact_m.y(), at.contact_m.z()}},
          {"direction", {at.direction.x(), at.direction.y(), at.direction.z()}},
          {"stop", acquisition::to_words(push.report.stop)},
          {"highest_force_n", push.report.highest_force_n},
          {"deepest_m", push.report.deepest_m},
          {"pushes_planned", push.pushes_planned > 0 ? nlohmann::json(push.pushes_planned) : nlohmann::json()},
          {"promised", spread_json(push.plan.expected)},
          {"found", spread_json(push.found)},
          {"young_modulus_pa", moduli_json(push.young_moduli)},
          {"young_modulus_within_95", young_modulus_half_width(push)},
          {"poisson_ratio", push.poisson_ratio.value},
          {"poisson_ratio_within_95", poisson_ratio_half_width(push.poisson_ratio)}};
}

std::string plans_of(const ExploredPush& push) {
  if (push.pushes_planned == 0) return "";
  if (push.pushes_planned == 1) return "; planned as the last one";
  return fmt::format("; planned with {} more", push.pushes_planned - 1);
}

/// What a loop leaves on the disk; a loop that recorded nothing leaves nothing, so that it can be run again.
struct Kept {
  Kept(const fs::path& out, const Recording& scene, std::optional<nlohmann::json> known)
      : folder(out), recording(out / "recording", scene), truth(out / "truth.json", std::move(known)) {}
  NewFolder folder;
  io::RecordingWriter recording;
  TruthFile truth;
};

/// One whole loop; in the lab, on an object of its own. `kept` only where it is recorded, `live` where it may be watched.
Explored run_loop(Session& session, const Options& given, PushRobot& robot, PushOrder order, Kept* kept, LiveReport* live) {
  ExploreOptions options = given.explore;
  options.order = order;
  if (!(options.push.travel_limit_m > 0)) options.push.travel_limit_m = robot.travel_limit_m();
  options.suggest.candidates.reachable = [&](const Vec3& contact_m, const Vec3& direction) {
    return robot.reaches(contact_m, direction, options.push.start_distance_m);
  };
  Recording scene = robot.scene();
  if (!given.law.empty()) scene.model.material = given.law;
  const bool first = order == PushOrder::next_best;
  ExploreHooks hooks;
  hooks.plan = [&](const estimation::PushCandidate& at) { return robot.plan_at(at.contact_m, at.direction); };
  std::string pushing;
  hooks.on_push_begin = [&](const Push& push) {
    pushing = push.name;
    if (kept != nullptr) kept->recording.begin_push(push);
  };
  hooks.on_step = [&](const Push& push, const Step& step) {
    if (kept == nullptr) return;
    kept->truth.add(robot.truth_of(push, step));
    kept->recording.add_step(step);
    kept->folder.keep();
    session.say(fmt::format("{}, {:.1f} s: {:.2f} N{}", push.name, step.time_s,
                            step.loads.empty() ? 0.0 : step.loads[0].force_n->norm(), step.unloading ? ", going back" : ""));
  };
  hooks.on_push_end = [&](const acquisition::PushReport& report) {
    if (kept == nullptr) return;
    if (report.drift) kept->recording.end_push(*report.drift);
    for (const std::string& warning : push_warnings(pushing, report)) session.warn(warning);
    if (report.stop == acquisition::StopReason::slip) session.warn(fmt::format("{}: {}", pushing, report.message));
  };
  hooks.on_push = [&](const ExploredPush& push) {
    const Vec3 &at = push.plan.candidate.contact_m, &along = push.plan.candidate.direction;
    session.say(fmt::format(
        "{}{} at ({:.3f} {:.3f} {:.3f}) along ({:+.2f} {:+.2f} {:+.2f}): E {} within {:.1f} % (promised {}), nu {:.3f} "
        "within {:.3f} (promised {}){}",
        first ? "" : "  ", push.name, at.x(), at.y(), at.z(), along.x(), along.y(), along.z(),
        moduli_words(push.young_moduli), 100 * young_modulus_half_width(push),
        percent_95(push.plan.expected.log_young_std), push.poisson_ratio.value, poisson_ratio_half_width(push.poisson_ratio),
        plain_95(push.plan.expected.poisson_std), plans_of(push)));
  };
  hooks.keep_going = [] { return !Session::interrupted(); };
  hooks.on_progress = session.progress();
  if (live != nullptr) {
    hooks.on_progress = live->watch(hooks.on_progress);
    options.identify.fit.on_estimate = live->on_estimate(scene);
  }
  return explore(robot.robot(), scene, options, hooks);
}

std::string count_of(const Explored& run) {
  const std::size_t pushes = run.pushes.size() + static_cast<std::size_t>(run.fruitless);
  return fmt::format("{} push{}", pushes, pushes == 1 ? "" : "es");
}

/// What the goal took, as far as it is known.
std::string needed(const Explored& run) { return (run.reached ? "" : "more than ") + count_of(run); }

int run(const Options& given, Session& session) {
  must_take_files(given.out);
  std::error_code code;
  if (fs::exists(given.out, code) && !fs::is_empty(given.out, code))
    throw Error("is there already, and explore begins anew; choose another folder or remove it (`palpate estimate` takes the "
                "recording in it)",
                given.out.string());
  check_push_options(given.explore.push);
  ExploreOptions with_limit = given.explore;
  with_limit.push.travel_limit_m = acquisition::PushOptions{}.travel_limit_m;  // the object's, which is not known yet
  check(with_limit);
  if (!given.law.empty())
    if (const auto wrong = wrong_material(given.law)) throw Error(*wrong, "--law");
  if (given.compare && !given.robot.driver.empty())
    throw Error("compares orders on fresh objects of the lab, and a driver's world has one only; leave it out", "--compare");
  LiveReport live(given.live, session, given.out.filename().string());
  const auto robot = push_robot(given.robot, session.seed);
  Recording scene = robot->scene();
  if (!given.law.empty()) scene.model.material = given.law;
  if (const auto wrong = wrong_material(scene.model.material)) throw Error(*wrong, given.robot.scene.string() + ": model.material");
  Kept kept(given.out, scene, robot->truth());
  Explored found = run_loop(session, given, *robot, PushOrder::next_best, &kept, &live);
  if (found.pushes.empty()) {
    session.warn(found.message);
    session.result({{"format", "palpate-exploration/1"}, {"reached", false}, {"message", found.message}});
    return exit_numbers;
  }
  Identification& answer = found.identified.answer;
  answer.provenance["seed"] = std::to_string(session.seed);
  answer.provenance["recording path"] = fs::absolute(given.out / "recording").lexically_normal().string();
  io::write_result(answer, given.out);
  io::write_model(answer, found.identified.volume, given.out / "model", found.identified.region);
  { const io::RecordingWriter object(given.out / "model", found.identified.object); }
  report::write_report(answer, &found.recording, given.out / "report.html");
  session.say(report::answer(answer));
  for (const auto& verdict : answer.verdicts) session.warn(fmt::format("{}: {}", verdict.code, verdict.message));
  session.say(
      fmt::format("{} after {}. Next: open {}", found.message, count_of(found), (given.out / "report.html").string()));

  live.finish(answer, found.recording, (given.out / "report.html").string());
  nlohmann::json json = {{"format", "palpate-exploration/1"}, {"reached", found.reached},
                         {"message", found.message},          {"fruitless", found.fruitless},
                         {"pushes", nlohmann::json::array()}, {"result", io::result_json(answer)}};
  for (const auto& push : found.pushes) json["pushes"].push_back(json_of(push));
  if (given.compare && !Session::interrupted()) {
    for (const auto& [order, name] :
         {std::pair{PushOrder::random, "random order"}, {PushOrder::best_repeated, "best place repeated"}}) {
      session.say(fmt::format("the same lab, {}:", name));
      const auto another = push_robot(given.robot, session.seed);  // its noise starts anew
      const Explored other = run_loop(session, given, *another, order, nullptr, nullptr);
      if (Session::interrupted()) break;
      session.say(fmt::format("{}: {}; next best push: {}", name, needed(other), needed(found)));
      nlohmann::json one = {{"order", name}, {"reached", other.reached}, {"pushes", nlohmann::json::array()}};
      for (const auto& push : other.pushes) one["pushes"].push_back(json_of(push));
      json["compared"].push_back(one);
    }
  }
  write_json(json, given.out / "exploration.json");
  session.result(json);
  return found.reached && answer.termination == Termination::converged ? exit_done : exit_numbers;
}

}  // namespace

Run verbs::explore(CLI::App& app) {
  auto given = std::make_shared<Options>();
  auto& options = given->explore;
  app.add_option("-o,--out", given->out,
                 "folder for recording/, result.json, model/, report.html, exploration.json and truth.json")
      ->required();
  app.add_option("--young-modulus-within", options.young_modulus_within, "goal: half of the 95 % interval over E, of every region")
      ->check(positive_number())
      ->capture_default_str();
  app.add_option("--poisson-ratio-within", options.poisson_ratio_within, "goal: half of the 95 % interval")
      ->check(positive_number())
      ->capture_default_str();
  app.add_option("--pushes", options.max_pushes, "most pushes")->check(positive_number())->capture_default_str();
  app.add_option("--for", given->goal, "young-modulus, poisson-ratio or both: what the next push is chosen for")
      ->check(CLI::IsMember({"young-modulus", "poisson-ratio", "both"}))
      ->capture_default_str();
  app.add_flag("--compare", given->compare, "also run the same lab with a random order and with the best place repeated");
  app.add_option("--levels", options.levels, "force steps of a push")->check(CLI::Range(1, 20))->capture_default_str();
  app.add_option("--contacts", options.suggest.candidates.contacts, "places that are compared")
      ->check(CLI::Range(1, 500))
      ->capture_default_str();
  app.add_option("--tilts", options.suggest.candidates.tilts, "slanted directions at each place, besides the straight one")
      ->check(CLI::Range(0, 12))
      ->capture_default_str();
  app.add_option("--guess", options.suggest.young_modulus_pa, "of Young's modulus before the first touch, Pa")
      ->check(positive_number())
      ->capture_default_str();
  app.add_option("--law", given->law, "material law of the estimate (default: that of the scene)");
  app.add_option("--refine", given->refine, "none or auto: finer under the tool")->check(CLI::IsMember({"none", "auto"}));
  given->live.add_to(app);
  add_push_limits(app, options.push);
  add_robot_options(app, given->robot);
  add_push_thresholds(app, options.push);
  return [given](Session& session) {
    Options chosen = *given;
    chosen.explore.suggest.goal = estimation::push_goal(given->goal);
    chosen.explore.suggest.candidates.seed = chosen.explore.seed = session.seed;
    chosen.explore.suggest.threads = chosen.explore.identify.fit.threads = session.thread_count();
    if (!given->refine.empty()) chosen.explore.identify.refine = given->refine;
    return run(chosen, session);
  };
}

}  // namespace palpate::cli
