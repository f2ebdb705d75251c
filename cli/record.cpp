// SPDX-License-Identifier: Apache-2.0
// `palpate record --demo -o FOLDER`: writes the built-in recording, made by the program's own lab.
#include <fmt/core.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/lab/built_in.hpp"

namespace palpate::cli {
namespace {

struct RecordArguments {
  bool demo = false;
  std::string output;
  std::string truth;
  double young_modulus_pa = 0;
  double poisson_ratio = -1;
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

int record(Session& session, const RecordArguments& arguments) {
  if (!arguments.demo) throw Error("records the built-in demonstration only; say --demo", "record");
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
  app.add_flag("--demo", arguments->demo, "the built-in recording: a foam cube on a table, pressed from above, simulated");
  app.add_option("-o,--output", arguments->output, "folder to write; must not exist or be empty")->required();
  app.add_option("--truth", arguments->truth, "also write what the simulation knows and the recording does not (JSON)");
  app.add_option("--young-modulus", arguments->young_modulus_pa,
                 "of the true object, Pa (drawn from the seed: 10 to 40 kPa)")
      ->check(CLI::PositiveNumber);
  app.add_option("--poisson-ratio", arguments->poisson_ratio, "of the true object (drawn from the seed: 0.1 to 0.45)")
      ->check(CLI::Range(0.0, 0.4999));
  return [arguments](Session& session) { return palpate::cli::record(session, *arguments); };
}

}  // namespace palpate::cli
