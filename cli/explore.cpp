// SPDX-License-Identifier: Apache-2.0
// `palpate explore -o OUT`: the lab's robot, or a driver's, pushes, estimates and chooses the next best push until E and nu are known as
// well as was asked for. OUT/recording grows step by step, exploration.json push by push; result, model and report come at the end.
// A run that was cut off goes on with --resume.
#include "palpate/explore.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "cli/compared_orders.hpp"
#include "cli/earlier_exploration.hpp"
#include "cli/exploration_file.hpp"
#include "cli/later_robot.hpp"
#include "cli/learned_object.hpp"
#include "cli/live_report.hpp"
#include "cli/material_names.hpp"
#include "cli/new_folder.hpp"
#include "cli/number_checks.hpp"
#include "cli/paths.hpp"
#include "cli/push_options.hpp"
#include "cli/push_robot.hpp"
#include "cli/push_words.hpp"
#include "cli/resumed_recording.hpp"
#include "cli/truth_file.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/io/result.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

struct ExploreArguments {
  RobotArguments robot;
  ExploreOptions explore;
  fs::path out;
  std::string goal = "both", law, refine;
  bool compare = false, resume = false;
  int seeds = 1, views = 0;
  LiveOptions live;
};

std::string plans_of(const ExploredPush& push) {
  if (push.pushes_planned == 0) return "";
  if (push.pushes_planned == 1) return "; planned as the last one";
  return fmt::format("; planned with {} more", push.pushes_planned - 1);
}

/// What a loop leaves on the disk; a loop that recorded nothing leaves nothing, so that it can be run again.
struct Kept {
  /// @param scene  with the pushes of an earlier run
  Kept(const fs::path& out, const Recording& scene, TruthFile of_steps)
      : folder(out), truth(std::move(of_steps)), pushes(out / "exploration.json"), recording(out / "recording", scene) {
    pushes.go_on(scene.pushes);
  }
  NewFolder folder;
  TruthFile truth;
  ExplorationFile pushes;
  io::RecordingWriter recording;
};

/// One whole loop; in the lab, on an object of its own. `kept` only where it is recorded, `live` where it may be watched.
/// @param scene  with pushes where it goes on
Explored run_loop(Session& session, const ExploreArguments& given, PushRobot& robot, const Recording& scene, PushOrder order, Kept* kept,
                  LiveReport* live) {
  ExploreOptions options = given.explore;
  options.order = order;
  if (!(options.push.travel_limit_m > 0)) options.push.travel_limit_m = robot.travel_limit_m();
  options.suggest.candidates.reachable = [&](const Vec3& contact_m, const Vec3& direction) {
    return robot.reaches(contact_m, direction, options.push.start_distance_m);
  };
  LaterRobot arm(robot.robot(), not_before_s(scene.pushes));
  const bool first = kept != nullptr;
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
    if (kept != nullptr) kept->pushes.add(push);
    if (push.earlier) {
      session.say(fmt::format("{} and all before it, by an earlier run: E {} within {:.1f} %, nu {:.3f} within {:.3f}", push.name,
                              moduli_words(push.young_moduli), 100 * young_modulus_half_width(push), push.poisson_ratio.value,
                              poisson_ratio_half_width(push.poisson_ratio)));
      return;
    }
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
  return explore(arm, scene, options, hooks);
}

int count(const Explored& run) { return static_cast<int>(run.pushes.size()) + run.fruitless; }

std::string count_of(const Explored& run) { return fmt::format("{} push{}", count(run), count(run) == 1 ? "" : "es"); }

/// What the goal took, as far as it is known.
std::string needed(const Explored& run) {
  const bool unbelieved = !run.reached && run.message.find("not to be believed") != std::string::npos;
  return (run.reached || unbelieved ? "" : "more than ") + count_of(run) + (unbelieved ? ", and was not to be believed" : "");
}

/// What stands before the robot, and which law it is taken to have.
Recording scene_of(const ExploreArguments& given, const PushRobot& robot) {
  Recording scene = robot.scene();
  if (!given.law.empty()) scene.model.material = given.law;
  if (const auto wrong = wrong_material(scene.model.material)) throw Error(*wrong, given.robot.scene.string() + ": model.material");
  return scene;
}

/// The other orders in the same lab; with --seeds in further labs, too, and the next best push there.
void compare(Session& session, const ExploreArguments& given, const Explored& found, nlohmann::json& json) {
  struct Order {
    PushOrder order;
    const char* name;
    std::vector<OrderedRun> runs;
  };
  Order orders[] = {{PushOrder::next_best, "next best push", {{found.reached, count(found)}}},
                    {PushOrder::random, "random order", {}},
                    {PushOrder::best_repeated, "best place repeated", {}}};
  for (int lab = 0; lab < given.seeds; ++lab) {
    ExploreArguments there = given;
    const std::uint64_t seed = session.seed + std::uint64_t(lab);
    there.explore.suggest.candidates.seed = there.explore.seed = seed;
    there.explore.identify.fit.cross_checks = false;  // a dozen labs: verdicts are those without them
    for (Order& one : orders) {
      if (lab == 0 && one.order == PushOrder::next_best) continue;
      session.say(fmt::format("{}, {}:", lab == 0 ? "the same lab" : fmt::format("the lab of seed {}", seed), one.name));
      const auto another = push_robot(given.robot, seed);  // its noise starts anew
      Recording scene = scene_of(given, *another);
      if (given.views > 0 && !look_around(*another, given.views, scene)) return;
      const Explored other = run_loop(session, there, *another, scene, one.order, nullptr, nullptr);
      if (Session::interrupted()) return;
      one.runs.push_back({other.reached, count(other)});
      if (lab > 0) continue;
      session.say(fmt::format("{}: {}; next best push: {}", one.name, needed(other), needed(found)));
      nlohmann::json told = {{"order", one.name}, {"reached", other.reached}, {"pushes", nlohmann::json::array()}};
      for (const auto& push : other.pushes) told["pushes"].push_back(json_of(push));
      json["compared"].push_back(told);
    }
  }
  if (given.seeds == 1) return;
  for (const Order& one : orders) {
    session.say(fmt::format("{}: {}", one.name, middle_words(one.runs)));
    json["by_seed"].push_back(by_seed_json(one.name, one.runs));
  }
}

int run(const ExploreArguments& given, Session& session) {
  must_take_files(given.out);
  std::error_code code;
  const bool exists = fs::exists(given.out, code) && !fs::is_empty(given.out, code);
  if (exists && !given.resume)
    throw Error("is there already; say --resume to go on, choose another folder or remove it (`palpate estimate` takes the "
                "recording in it)",
                given.out.string());
  if (!exists && given.resume) throw Error("holds nothing to go on with; is it the right folder? Leave --resume out to begin", given.out.string());
  check_push_options(given.explore.push);
  ExploreOptions with_limit = given.explore;
  with_limit.push.travel_limit_m = acquisition::PushOptions{}.travel_limit_m;  // the object's, which is not known yet
  check(with_limit);
  if (!given.law.empty())
    if (const auto wrong = wrong_material(given.law)) throw Error(*wrong, "--law");
  if (given.compare && !given.robot.driver.empty())
    throw Error("compares orders on fresh objects of the lab, and a driver's world has one only; leave it out", "--compare");
  if (given.seeds > 1 && !given.compare) throw Error("says in how many labs orders are compared; say --compare, too", "--seeds");
  LiveReport live(given.live, session, given.out.filename().string());
  const auto robot = push_robot(given.robot, session.seed);
  Recording scene = scene_of(given, *robot);
  must_clear(scene.tools, given.explore.push);
  ExploreArguments loop = given;
  loop.explore.go_on = exists;
  TruthFile truth(given.out / "truth.json", robot->truth());
  if (exists) {
    EarlierExploration earlier = earlier_exploration(given.out, scene, given.views);
    scene = std::move(earlier.recording);
    truth.go_on(scene.pushes);
    std::size_t steps = 0;
    for (const Push& push : scene.pushes) steps += push.steps.size();
    robot->go_on_after(steps);
    for (const std::string& words : earlier.words) session.warn(words);
  } else if (given.views > 0 && !look_around(*robot, given.views, scene)) {
    session.say("stopped on request before the first push; nothing was recorded");
    session.result({{"format", "palpate-exploration/1"}, {"reached", false}, {"message", "stopped on request"}});
    return exit_numbers;
  }
  Kept kept(given.out, scene, std::move(truth));
  Explored found = run_loop(session, loop, *robot, scene, PushOrder::next_best, &kept, &live);
  if (found.pushes.empty() || found.identified.answer.termination == Termination::cancelled) {  // what stands in the folder stays
    session.warn(found.message);
    session.result({{"format", "palpate-exploration/1"}, {"reached", false}, {"message", found.message}});
    return exit_numbers;
  }
  Identification& answer = found.identified.answer;
  answer.provenance["seed"] = std::to_string(session.seed);
  answer.provenance["recording path"] = fs::absolute(given.out / "recording").lexically_normal().string();
  write_learned_object(found.identified, found.recording, given.out);
  session.say(report::answer(answer));
  for (const auto& verdict : answer.verdicts) session.warn(fmt::format("{}: {}", verdict.code, verdict.message));
  session.say(
      fmt::format("{} after {}. Next: open {}", found.message, count_of(found), (given.out / "report.html").string()));

  if (found.fixed_lists) session.say(fmt::format("For this goal, {}", words_of(*found.fixed_lists, given.explore.max_pushes)));
  live.finish(answer, found.recording, (given.out / "report.html").string());
  nlohmann::json json = {{"format", "palpate-exploration/1"}, {"reached", found.reached},
                         {"message", found.message},          {"fruitless", found.fruitless},
                         {"pushes", kept.pushes.pushes(found)}, {"result", io::result_json(answer)}};
  if (found.fixed_lists) json["expected_of_fixed_lists"] = json_of(*found.fixed_lists);
  if (given.compare && !Session::interrupted()) compare(session, given, found, json);
  kept.pushes.write(json);
  session.result(json);
  return found.reached && answer.termination == Termination::converged && !Session::interrupted() ? exit_done : exit_numbers;
}

}  // namespace

Run verbs::explore(CLI::App& app) {
  auto given = std::make_shared<ExploreArguments>();
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
  app.add_flag("--resume", given->resume, "go on with a run that was cut off: its pushes are estimated once and count");
  add_views_option(app, given->views);
  app.add_flag("--compare", given->compare, "also run the same lab with a random order and with the best place repeated");
  app.add_option("--seeds", given->seeds, "with --compare: so many labs, from --seed on, and what is in the middle of them")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
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
    ExploreArguments chosen = *given;
    chosen.explore.suggest.goal = estimation::push_goal(given->goal);
    chosen.explore.suggest.candidates.seed = chosen.explore.seed = session.seed;
    chosen.explore.suggest.threads = chosen.explore.identify.fit.threads = session.thread_count();
    if (!given->refine.empty()) chosen.explore.identify.refine = given->refine;
    return run(chosen, session);
  };
}

}  // namespace palpate::cli
