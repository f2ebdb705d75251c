// SPDX-License-Identifier: Apache-2.0
// From a bag to a recording: `io` reads messages and mapping, `acquisition` makes steps of them. Only a front may know both.
#include "cli/bag_recording.hpp"

#include <fmt/format.h>

#include "cli/paths.hpp"
#include "palpate/acquisition/from_streams.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/bag_mapping.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::cli {

namespace fs = std::filesystem;

fs::path mapping_of(const fs::path& bag) {
  std::error_code code;
  const fs::path beside = (fs::is_directory(bag, code) ? bag : bag.parent_path()) / "mapping.yaml";
  return fs::is_regular_file(beside, code) ? beside : fs::path();
}

Recording load_recording_unchecked(Session& session, const fs::path& path, const fs::path& given) {
  must_exist(path, "a recording is a folder with recording.yaml in it, or a bag (docs/recording-format.md)");
  if (!io::is_bag(path)) {
    if (!given.empty()) throw Error("is a recording; only a bag needs a mapping", path.string());
    return io::read_recording_unchecked(path);
  }
  const fs::path file = given.empty() ? mapping_of(path) : given;
  if (file.empty())
    throw Error("is a bag: say what its topics mean with --mapping FILE; `palpate info` suggests one", path.string());
  io::BagMapping mapping = io::read_mapping(file);
  const io::MessageSource bag = io::read_bag(path);
  const SensorStreams streams = io::read_streams(bag, mapping);
  acquisition::FromStreams made = acquisition::recording_from(mapping.plan, streams);
  for (const acquisition::ClockOffset& clock : made.clocks)
    if (clock.usable)
      session.say(fmt::format("clock      {}: {:+.1f} +- {:.1f} ms against the arm's (correlation {:.2f}), taken off",
                              clock.sensor, 1e3 * clock.offset_s, 1e3 * clock.std_s, clock.correlation));
  for (const std::string& note : made.notes) session.warn(note);
  std::error_code code;
  if (fs::is_regular_file(path, code))
    made.recording.input_hashes[path.filename().string()] = io::sha256_hex(io::read_file(path));
  return std::move(made.recording);
}

Recording load_recording(Session& session, const fs::path& path, const fs::path& mapping) {
  Recording recording = load_recording_unchecked(session, path, mapping);
  const auto problems = io::check_recording(recording);
  if (!problems.empty()) {
    const std::string more =
        problems.size() > 1 ? fmt::format(" ({} more: `palpate info` lists them)", problems.size() - 1) : std::string();
    throw Error(problems.front().what + more, problems.front().where);
  }
  for (std::string& odd : io::odd_numbers(recording)) recording.warnings.push_back(std::move(odd));
  return recording;
}

}  // namespace palpate::cli
