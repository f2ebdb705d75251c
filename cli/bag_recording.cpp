// SPDX-License-Identifier: Apache-2.0
#include "cli/bag_recording.hpp"

#include <fmt/format.h>

#include "cli/paths.hpp"

namespace palpate::cli {

namespace fs = std::filesystem;

std::string to_words(const acquisition::ClockOffset& clock) {
  if (!clock.usable) return "not to be told, nothing taken off";
  const double taken_s = acquisition::believed_offset_s(clock);
  return fmt::format("{:+.1f} +- {:.1f} ms against the arm's (correlation {:.2f}), {}", 1e3 * clock.offset_s,
                     1e3 * clock.std_s, clock.correlation,
                     taken_s == 0 ? std::string("no evidence of any: nothing taken off")
                                  : fmt::format("{:+.1f} ms taken off", 1e3 * taken_s));
}

LoadedRecording load_existing(const fs::path& path, const fs::path& mapping) {
  must_exist(path, "a recording is a folder with recording.yaml in it, or a bag (docs/recording-format.md)");
  return palpate::load_recording(path, mapping);
}

Recording load_recording_unchecked(Session& session, const fs::path& path, const fs::path& mapping,
                                   std::vector<acquisition::ClockOffset>* clocks) {
  LoadedRecording loaded = load_existing(path, mapping);
  for (const acquisition::ClockOffset& clock : loaded.clocks)
    if (clock.usable) session.say(fmt::format("clock      {}: {}", clock.sensor, to_words(clock)));
  if (clocks != nullptr) *clocks = std::move(loaded.clocks);
  return std::move(loaded.recording);
}

Recording load_recording(Session& session, const fs::path& path, const fs::path& mapping,
                         std::vector<acquisition::ClockOffset>* clocks) {
  Recording recording = load_recording_unchecked(session, path, mapping, clocks);
  check_loaded(recording);
  return recording;
}

}  // namespace palpate::cli
