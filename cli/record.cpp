// SPDX-License-Identifier: Apache-2.0
// `palpate record --object NAME|FILE -o FOLDER`: the push protocol on the lab's robot at every site of an object, written step
// by step, so that a run that was cut off can go on. `--demo` writes the built-in recording instead.
#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "cli/later_robot.hpp"
#include "cli/logged_robot.hpp"
#include "cli/new_folder.hpp"
#include "cli/paths.hpp"
#include "cli/push_options.hpp"
#include "cli/push_robot.hpp"
#include "cli/push_words.hpp"
#include "cli/resumed_recording.hpp"
#include "cli/truth_file.hpp"
#include "cli/verbs.hpp"
#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/bag_write.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/lab/built_in.hpp"

namespace palpate::cli {
namespace {

struct RecordArguments {
  bool demo = false;
  RobotArguments robot;
  std::string output;
  std::string truth;
  bool resume = false;
  int views = 0;
  std::string bag, raw_bag;
  acquisition::PushOptions push;
};

nlohmann::json demo_truth_json(const lab::DemoTruth& truth) {
  nlohmann::json json = {{"young_modulus_pa", truth.young_modulus_pa},
                         {"poisson_ratio", truth.poisson_ratio},
                         {"material", truth.material},
                         {"force_scale", truth.force_scale},
                         {"force_n", truth.force_n},
                         {"travel_m", truth.travel_m},
                         {"travel_offset_m", truth.travel_offset_m},
                         {"nodes", truth.nodes},
                         {"tetrahedra", truth.tetrahedra}};
  for (const Vec3& tare : truth.force_tare_n) json["force_tare_n"].push_back({tare.x(), tare.y(), tare.z()});
  return json;
}

struct Made {
  nlohmann::json told = nlohmann::json::array();
  int steps = 0;
  bool loaded = false;  ///< some step is under load: there is something to estimate
  bool fine = true;
};

nlohmann::json json_of(const acquisition::PushPlan& plan, const acquisition::PushReport& report) {
  const bool touched = report.deepest_m > 0;
  nlohmann::json drift_n_s;
  if (report.drift) drift_n_s = {report.drift->rate_n_s.x(), report.drift->rate_n_s.y(), report.drift->rate_n_s.z()};
  return {{"push", plan.name},
          {"site", plan.site},
          {"stop", acquisition::to_words(report.stop)},
          {"message", report.message},
          {"steps", report.steps},
          {"blank_images", report.blank_images},
          {"highest_force_n", report.highest_force_n},
          {"deepest_m", report.deepest_m},
          {"overshoot_n", report.overshoot_n},
          {"contact_m", touched ? nlohmann::json({report.contact_m.x(), report.contact_m.y(), report.contact_m.z()}) : nlohmann::json()},
          {"drift_n", report.drift ? nlohmann::json(report.drift_n) : nlohmann::json()},
          {"drift_n_s", drift_n_s},
          {"turned_rad", report.turned_rad},
          {"unsettled", report.unsettled},
          {"came_back", report.compared ? nlohmann::json(report.came_back) : nlohmann::json()},
          {"changed_share", report.compared ? nlohmann::json(report.changed_share) : nlohmann::json()}};
}

/// The force or the object ended it, not the robot or the user.
bool ended_well(acquisition::StopReason stop) {
  using enum acquisition::StopReason;
  return acquisition::is_at_a_limit(stop) || stop == slip || stop == contact_lost;
}

/// A folder that is read may hold loads of nothing.
bool is_loaded(const Step& step) {
  return std::any_of(step.loads.begin(), step.loads.end(), [](const Load& load) { return load.force_n && load.force_n->norm() > 0; });
}
bool is_loaded(const Push& push) { return std::any_of(push.steps.begin(), push.steps.end(), [](const Step& step) { return is_loaded(step); }); }

const Push* push_named(const std::vector<Push>& pushes, const std::string& name) {
  for (const Push& push : pushes)
    if (push.name == name) return &push;
  return nullptr;
}

// Runs the protocol at every site; every finished step is on the disk before the next one begins.
int record_pushes(Session& session, const RecordArguments& arguments) {
  std::filesystem::path folder = arguments.output;
  if (!folder.has_filename()) folder = folder.parent_path();  // written with a slash at its end
  const bool exists = std::filesystem::exists(folder) && !std::filesystem::is_empty(folder);
  if (exists && !arguments.resume)
    throw Error("is there already; say --resume to go on, or choose another folder", folder.string());
  if (!exists && arguments.resume) throw Error("holds nothing to go on with; is it the right folder? Leave --resume out to begin", folder.string());
  check_push_options(arguments.push);
  const std::filesystem::path truth_file =
      std::filesystem::path(arguments.truth.empty() ? folder.string() + ".truth.json" : arguments.truth);
  if (!arguments.truth.empty() || arguments.robot.driver.empty()) must_take_file(truth_file);
  const auto robot = push_robot(arguments.robot, session.seed);
  if (robot->sites() == 0) throw Error("say where to push: --contact X Y Z, in metres, base frame", "--driver");
  acquisition::PushOptions protocol = arguments.push;
  if (!(protocol.travel_limit_m > 0)) protocol.travel_limit_m = robot->travel_limit_m();
  TruthFile truth(truth_file, robot->truth());
  if (!truth.is_known() && !arguments.truth.empty()) throw Error("nobody knows the truth of a driver's world; leave it out", "--truth");
  Recording recording = robot->scene();
  must_clear(recording.tools, protocol);
  std::vector<acquisition::PushPlan> plans;
  for (std::size_t site = 0; site < robot->sites(); ++site) plans.push_back(robot->plan(site));
  if (exists) {
    const Recording now = std::exchange(recording, io::read_recording_unchecked(folder));
    must_be_same_scene(recording, now, arguments.views > 0 && arguments.views == int(recording.rest.views.size()), folder);
    for (const acquisition::PushPlan& plan : plans)
      if (const Push* recorded = push_named(recording.pushes, plan.name)) must_be_same_push(*recorded, plan, protocol, folder);
    truth.go_on(recording.pushes);
  } else if (arguments.views > 0) {
    if (!look_around(*robot, arguments.views, recording)) {
      session.say("stopped on request before the first push; nothing was recorded");
      session.result({{"recording", arguments.output}, {"steps", 0}, {"pushes", nlohmann::json::array()}});
      return exit_numbers;
    }
  }
  const std::vector<Push> recorded = recording.pushes;
  std::size_t steps_before = 0;
  for (const Push& push : recorded) steps_before += push.steps.size();
  robot->go_on_after(steps_before);
  NewFolder made_here(folder);
  io::RecordingWriter writer(folder, recording);
  EarlierRawBag so_far_said;
  if (arguments.resume && !arguments.raw_bag.empty()) so_far_said = earlier_raw_bag(arguments.raw_bag);
  if (!arguments.raw_bag.empty() && !recorded.empty() && so_far_said.bag.last_ns() == 0)
    session.warn("--raw-bag: holds only what the sensors say from now on: the run that began this recording left no such bag there");
  LaterRobot later(robot->robot(), std::max(not_before_s(recorded), not_before_s(so_far_said)));
  Recording scene = recording;
  scene.pushes.clear();
  LoggedRobot logged(later, scene, std::move(so_far_said));
  Made made;
  made.loaded = std::any_of(recorded.begin(), recorded.end(), [](const Push& push) { return is_loaded(push); });
  for (std::size_t site = 0; site < plans.size() && !Session::interrupted(); ++site) {
    const acquisition::PushPlan plan = robot->plan(site);  // the robot then presses there
    if (!(arguments.push.force_step_n > 0)) protocol.force_step_n = robot->force_step_n(site);
    const Push* const so_far = push_named(recorded, plan.name);
    if (so_far != nullptr && so_far != &recorded.back()) continue;  // a later one was begun
    bool begun = so_far != nullptr, loaded = so_far != nullptr && is_loaded(*so_far);
    const acquisition::PushReport report = acquisition::run_push(
        logged, plan, protocol,
        [&](const Push& push, const Step& step) {
          truth.add(robot->truth_of(push, step));
          if (!begun) writer.begin_push(push);
          begun = true;
          writer.add_step(step);
          loaded = loaded || is_loaded(step);
          made_here.keep();
          if (!arguments.raw_bag.empty()) logged.write_bag_if_small(arguments.raw_bag, protocol);
          const double force = step.loads.empty() ? 0.0 : step.loads[0].force_n->norm();
          session.say(fmt::format("{} ({}), {:.1f} s: {:.2f} N{}", push.name, plan.site, step.time_s, force,
                                  step.unloading ? ", going back" : ""));
        },
        [] { return !Session::interrupted(); }, so_far);
    if (report.drift && report.steps > 0) writer.end_push(*report.drift);
    if (!arguments.raw_bag.empty()) logged.write_bag(arguments.raw_bag, protocol);
    for (const std::string& warning : push_warnings(plan.name, report)) session.warn(warning);
    const std::string why = stop_words(plan, report, protocol.start_distance_m);
    if (report.steps == 0 && so_far == nullptr && report.stop != acquisition::StopReason::user)
      session.warn(fmt::format("{}: nothing was recorded: {}", plan.name, why));
    else
      session.say(fmt::format("{} stopped: {} ({}). {:.1f} N, {:.1f} mm; {} steps", plan.name, acquisition::to_words(report.stop), why,
                              report.highest_force_n, 1000 * report.deepest_m, report.steps));
    if (report.stop == acquisition::StopReason::slip) session.warn(fmt::format("{}: {}", plan.name, report.message));
    if (report.steps > 0 && !loaded && report.stop != acquisition::StopReason::user)
      session.warn(fmt::format("{}: {} before any step under load, so nothing can be estimated from it; push elsewhere or more across the "
                               "surface, or with a smaller --force-step",
                               plan.name, acquisition::to_words(report.stop)));
    made.told.push_back(json_of(plan, report));
    made.steps += report.steps;
    made.loaded = made.loaded || loaded;
    made.fine = made.fine && loaded && ended_well(report.stop);
    if (report.stop == acquisition::StopReason::obstacle) break;  // a person looks first; --resume goes on
  }
  const bool nothing = made.steps == 0 && recorded.empty();
  session.say(nothing ? fmt::format("{}: nothing was recorded", arguments.output)
                      : fmt::format("{}: {} steps{}. {}", arguments.output, made.steps,
                                    truth.is_known() ? "; the truth is in " + truth_file.string() : "",
                                    made.loaded ? fmt::format("Next: palpate estimate {} -o RESULT", arguments.output)
                                                : "None is under load: nothing can be estimated from it"));
  if (!arguments.raw_bag.empty())
    session.say(fmt::format("{}: all that the sensors said, as a robot's recorder keeps it", arguments.raw_bag));
  nlohmann::json json = {{"recording", arguments.output},
                         {"object", recording.name},
                         {"steps", made.steps},
                         {"pushes", made.told},
                         {"seed", session.seed}};
  if (truth.is_known() && !nothing) json["truth"] = truth_file.string();
  session.result(json);
  return made.fine && !Session::interrupted() ? exit_done : exit_numbers;
}

int record_demo(Session& session, const RecordArguments& arguments) {
  if (std::filesystem::exists(arguments.output) && !std::filesystem::is_empty(arguments.output))
    throw Error("is there already; choose another folder or remove it", arguments.output);
  if (!arguments.truth.empty()) must_take_file(arguments.truth);
  lab::DemoOptions options;
  options.seed = session.seed;
  options.threads = session.thread_count();
  if (arguments.robot.lab.young_modulus_pa != 0) options.young_modulus_pa = arguments.robot.lab.young_modulus_pa;
  if (arguments.robot.lab.poisson_ratio >= 0) options.poisson_ratio = arguments.robot.lab.poisson_ratio;
  const lab::Demo demo = lab::make_demo(options, session.progress());
  io::write_recording(demo.recording, arguments.output);
  if (!arguments.truth.empty()) write_json_aside(demo_truth_json(demo.truth), arguments.truth);
  std::size_t steps = 0;
  for (const Push& push : demo.recording.pushes) steps += push.steps.size();
  session.say(fmt::format("{}: {} pushes, {} steps. Next: palpate estimate {} -o RESULT", arguments.output,
                          demo.recording.pushes.size(), steps, arguments.output));
  session.result(
      {{"recording", arguments.output}, {"pushes", demo.recording.pushes.size()}, {"steps", steps}, {"seed", options.seed}});
  return exit_done;
}

/// Hours of pushing must not end at a closed door.
void must_take_outputs(const RecordArguments& arguments) {
  std::error_code code;
  must_take_files(arguments.output);
  std::set<std::filesystem::path> folders{std::filesystem::weakly_canonical(std::filesystem::path(arguments.output) / "", code)};
  for (const auto& [option, bag] : {std::pair{"--bag", arguments.bag}, {"--raw-bag", arguments.raw_bag}}) {
    if (bag.empty()) continue;
    must_take_files(bag);
    const bool goes_on = arguments.resume && bag == arguments.raw_bag && io::is_bag(bag);
    if (!goes_on && std::filesystem::exists(bag, code) && !std::filesystem::is_empty(bag, code))
      throw Error("is there already; choose another folder or remove it", bag);
    if (!folders.insert(std::filesystem::weakly_canonical(std::filesystem::path(bag) / "", code)).second)
      throw Error("names a folder that is written already; give it one of its own", option);
  }
}

}  // namespace

Run verbs::record(CLI::App& app) {
  auto arguments = std::make_shared<RecordArguments>();
  app.add_flag("--demo", arguments->demo, "the built-in recording: a foam cube on a table, pressed from above, simulated");
  app.add_option("-o,--out,--output", arguments->output, "folder to write; must not exist or be empty")->required();
  add_views_option(app, arguments->views);
  app.add_option("--truth", arguments->truth,
                 "file for what the simulation knows and the recording does not (default: beside the recording, OUTPUT.truth.json; "
                 "with --demo: not written)");
  app.add_option("--bag", arguments->bag, "also write a bag (rosbag2: MCAP) with its mapping into this folder");
  app.add_option("--raw-bag", arguments->raw_bag,
                 "also write what the sensors said all the while (MCAP), as a robot's own recorder does");
  app.add_flag("--resume", arguments->resume, "go on with a recording that was cut off");
  // The object says how deep a soft pad can press it and in which steps: less than the paper's 10 cm.
  add_push_limits(app, arguments->push);
  add_force_step_option(app, arguments->push);
  add_robot_options(app, arguments->robot);
  add_contact_options(app, arguments->robot);
  add_push_thresholds(app, arguments->push);
  // What the built-in recording cannot do is refused, not passed over. (`excludes` would name it all in the help.)
  const std::set<std::string> of_the_demo{"--help", "--demo", "--out", "--truth", "--young-modulus", "--poisson-ratio", "--bag"};
  std::vector<const CLI::Option*> not_of_the_demo;
  for (const CLI::Option* option : app.get_options()) {
    const bool known = std::any_of(of_the_demo.begin(), of_the_demo.end(), [&](const auto& name) { return option->check_name(name); });
    if (!known) not_of_the_demo.push_back(option);
  }
  return [arguments, not_of_the_demo](Session& session) {
    for (const CLI::Option* option : not_of_the_demo)
      if (arguments->demo && option->count() > 0)
        throw Error("the built-in recording takes no " + option->get_name() + "; leave one of the two out", "--demo");
    must_take_outputs(*arguments);
    const int outcome = arguments->demo ? record_demo(session, *arguments) : record_pushes(session, *arguments);
    std::error_code code;
    if (!arguments->bag.empty() && std::filesystem::exists(std::filesystem::path(arguments->output) / "recording.yaml", code)) {
      io::write_bag(io::read_recording_unchecked(arguments->output), arguments->bag);
      session.say(fmt::format("{}: the same as a bag of ROS 2", arguments->bag));
    }
    return outcome;
  };
}

}  // namespace palpate::cli
