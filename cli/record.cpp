// SPDX-License-Identifier: Apache-2.0
// `palpate record -o FOLDER`: the push protocol on the lab's robot, written step by step, so that a run that was cut off can
// go on. `--demo` writes the built-in recording instead.
#include <fmt/core.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "cli/logged_robot.hpp"
#include "cli/verbs.hpp"
#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/bag_write.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/lab/built_in.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::cli {
namespace {

struct RecordArguments {
  bool demo = false;
  std::string output;
  std::string truth;
  double young_modulus_pa = 0;
  double poisson_ratio = -1;
  bool resume = false;
  std::string bag, raw_bag;
  acquisition::PushOptions push;
};

nlohmann::json truth_json(const lab::DemoTruth& truth) {
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

// Runs the protocol; every finished step is on the disk before the next one begins.
int record_push(Session& session, const RecordArguments& arguments) {
  const std::filesystem::path folder = arguments.output;
  const bool exists = std::filesystem::exists(folder) && !std::filesystem::is_empty(folder);
  if (exists && !arguments.resume)
    throw Error("is there already; say --resume to go on, or choose another folder", folder.string());
  lab::LabOptions options;
  options.seed = session.seed;
  if (arguments.young_modulus_pa != 0) options.object.young_modulus_pa = arguments.young_modulus_pa;
  if (arguments.poisson_ratio >= 0) options.object.poisson_ratio = arguments.poisson_ratio;
  lab::LabRobot robot(options);
  Recording recording = robot.scene();
  if (exists) {
    recording = io::read_recording_unchecked(folder);
    // The recording's clock goes on from its last step.
    if (!recording.pushes.empty() && !recording.pushes.back().steps.empty())
      robot.wait(recording.pushes.back().steps.back().time_s + 1);
  }
  const acquisition::PushPlan plan = robot.plan();
  const Push* so_far = nullptr;
  for (const Push& push : recording.pushes)
    if (push.name == plan.name) so_far = &push;
  io::RecordingWriter writer(folder, recording);
  LoggedRobot logged(robot, recording.joint_names);
  bool begun = so_far != nullptr;
  const acquisition::PushReport report = acquisition::run_push(
      logged, plan, arguments.push,
      [&](const Push& push, const Step& step) {
        if (!begun) writer.begin_push(push);
        begun = true;
        writer.add_step(step);
        const double force = step.loads.empty() ? 0.0 : step.loads[0].force_n->norm();
        session.say(fmt::format("step at {:.1f} s: {:.2f} N{}", step.time_s, force, step.unloading ? ", going back" : ""));
      },
      [] { return !Session::interrupted(); }, so_far);
  for (const int step : report.unsettled) session.warn(fmt::format("step {} had not settled when it was recorded", step));
  session.say(fmt::format("stopped: {} ({}). {:.1f} N, {:.1f} mm; {} steps in {}", acquisition::to_words(report.stop),
                          report.message, report.highest_force_n, 1000 * report.deepest_m, report.steps, arguments.output));
  if (!arguments.raw_bag.empty()) {
    Recording scene = robot.scene();
    scene.robot.reset();  // the masks are in the bag
    scene.joint_names.clear();
    logged.write_bag(scene, arguments.raw_bag);
    session.say(fmt::format("{}: all that the sensors said, as a robot's recorder keeps it", arguments.raw_bag));
  }
  session.result({{"recording", arguments.output},
                  {"stop", acquisition::to_words(report.stop)},
                  {"message", report.message},
                  {"steps", report.steps},
                  {"highest_force_n", report.highest_force_n},
                  {"deepest_m", report.deepest_m},
                  {"unsettled", report.unsettled},
                  {"seed", options.seed}});
  return report.stop == acquisition::StopReason::user || report.stop == acquisition::StopReason::no_contact ? exit_numbers
                                                                                                            : exit_done;
}

int record_demo(Session& session, const RecordArguments& arguments) {
  if (std::filesystem::exists(arguments.output) && !std::filesystem::is_empty(arguments.output))
    throw Error("is there already; choose another folder or remove it", arguments.output);
  lab::DemoOptions options;
  options.seed = session.seed;
  options.threads = session.thread_count();
  if (arguments.young_modulus_pa != 0) options.young_modulus_pa = arguments.young_modulus_pa;
  if (arguments.poisson_ratio >= 0) options.poisson_ratio = arguments.poisson_ratio;
  const lab::Demo demo = lab::make_demo(options, session.progress());
  io::write_recording(demo.recording, arguments.output);
  if (!arguments.truth.empty()) {
    std::ofstream file(arguments.truth);
    file << truth_json(demo.truth).dump(2) << '\n';
    if (!file) throw Error("cannot be written", arguments.truth);
  }
  std::size_t steps = 0;
  for (const Push& push : demo.recording.pushes) steps += push.steps.size();
  session.say(fmt::format("{}: {} pushes, {} steps. Next: palpate estimate {} -o RESULT", arguments.output,
                          demo.recording.pushes.size(), steps, arguments.output));
  session.result(
      {{"recording", arguments.output}, {"pushes", demo.recording.pushes.size()}, {"steps", steps}, {"seed", options.seed}});
  return exit_done;
}

}  // namespace

Run verbs::record(CLI::App& app) {
  auto arguments = std::make_shared<RecordArguments>();
  // The lab's foam caves in beyond what a soft pad can press: less than the paper's 50 N and 10 cm.
  arguments->push.force_limit_n = 8;
  arguments->push.travel_limit_m = 0.013;
  app.add_flag("--demo", arguments->demo, "the built-in recording: a foam cube on a table, pressed from above, simulated");
  app.add_option("-o,--output", arguments->output, "folder to write; must not exist or be empty")->required();
  app.add_option("--truth", arguments->truth, "also write what the simulation knows and the recording does not (JSON)");
  app.add_option("--young-modulus", arguments->young_modulus_pa,
                 "of the true object, Pa (drawn from the seed: 10 to 40 kPa)")
      ->check(CLI::PositiveNumber);
  app.add_option("--poisson-ratio", arguments->poisson_ratio, "of the true object (drawn from the seed: 0.1 to 0.45)")
      ->check(CLI::Range(0.0, 0.4999));
  app.add_option("--force-limit", arguments->push.force_limit_n, "stop at this force, N")->check(CLI::PositiveNumber);
  app.add_option("--travel-limit", arguments->push.travel_limit_m, "stop at this travel, m")->check(CLI::PositiveNumber);
  app.add_option("--force-step", arguments->push.force_step_n, "between recorded steps, N")->check(CLI::PositiveNumber);
  app.add_option("--bag", arguments->bag, "also write a bag (rosbag2: MCAP) with its mapping into this folder");
  app.add_option("--raw-bag", arguments->raw_bag,
                 "also write what the sensors said all the while (MCAP), as a robot's own recorder does");
  app.add_flag("--resume", arguments->resume, "go on with a recording that was cut off");
  return [arguments](Session& session) {
    std::error_code code;
    for (const std::string& bag : {arguments->bag, arguments->raw_bag}) {
      if (!bag.empty() && std::filesystem::exists(bag, code) && !std::filesystem::is_empty(bag, code))
        throw Error("is there already; choose another folder or remove it", bag);
    }
    if (arguments->demo && !arguments->raw_bag.empty())
      throw Error("the built-in recording is made without a robot; leave --demo out", "--raw-bag");
    const int outcome = arguments->demo ? record_demo(session, *arguments) : record_push(session, *arguments);
    if (!arguments->bag.empty()) {
      io::write_bag(io::read_recording_unchecked(arguments->output), arguments->bag);
      session.say(fmt::format("{}: the same as a bag of ROS 2", arguments->bag));
    }
    return outcome;
  };
}

}  // namespace palpate::cli
