// SPDX-License-Identifier: Apache-2.0
// From a bag to a recording: `io` reads messages and mapping, `acquisition` makes steps of them.
#include "palpate/load_recording.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "palpate/acquisition/from_streams.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/bag_mapping.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/io/yaml_field.hpp"
#include "palpate/recording_oddities.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate {

namespace fs = std::filesystem;

fs::path mapping_of(const fs::path& bag) {
  std::error_code code;
  const fs::path beside = (fs::is_directory(bag, code) ? bag : bag.parent_path()) / "mapping.yaml";
  return fs::is_regular_file(beside, code) ? beside : fs::path();
}

namespace {

/// A mistyped sensor would only show when its noise is first asked for, far from the file.
void check_noise(const std::string& model, const std::string& where) {
  std::vector<std::string> names{"constant"};
  for (const sensing::DepthNoiseModel& one : sensing::depth_noise_models()) names.emplace_back(one.name);
  if (std::find(names.begin(), names.end(), model) != names.end()) return;
  const auto meant = io::nearest_word(model, names);
  throw Error(fmt::format("no noise model is called '{}';{} they are {}", model.substr(0, 60),
                          meant ? fmt::format(" did you mean '{}'?", *meant) : "", fmt::join(names, ", ")),
              where);
}

void check_noise(const Recording& recording, const fs::path& path) {
  std::error_code code;
  const fs::path file = fs::is_directory(path, code) ? path / "recording.yaml" : path;
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps)
      for (const Observation& one : step.observations)
        if (const auto* frame = std::get_if<DepthFrame>(&one)) check_noise(frame->noise.model, file.string() + ": cameras: noise.model");
}

/// What a bag lost (it was cut off, say), or what was taken otherwise than it says, may be why nothing can be made of it.
acquisition::FromStreams recording_of(const io::MessageSource& bag, io::BagMapping& mapping) {
  std::vector<std::string> warnings = bag.warnings;
  try {
    const SensorStreams streams = io::read_streams(bag, mapping);
    warnings = streams.warnings;  // the bag's first
    return acquisition::recording_from(mapping.plan, streams);
  } catch (const Error& error) {
    if (warnings.empty() || error.message().find(warnings.front()) != std::string::npos) throw;
    throw Error(fmt::format("{}{} Of the bag: {}", error.message(), error.message().ends_with("?") ? "" : ".", warnings.front()), error.where());
  }
}

}  // namespace

LoadedRecording load_recording(const fs::path& path, const fs::path& given) {
  std::error_code code;
  if (!fs::exists(path, code))
    throw Error((code ? "cannot be looked at (" + code.message() + ")" : std::string("there is no such file or folder")) +
                    "; a recording is a folder with recording.yaml in it, or a bag (docs/recording-format.md)", path.string());
  if (!io::is_bag(path)) {
    if (!given.empty()) throw Error("is a recording; only a bag needs a mapping", path.string());
    Recording recording = io::read_recording_unchecked(path);
    check_noise(recording, path);
    return {std::move(recording), {}};
  }
  const fs::path file = given.empty() ? mapping_of(path) : given;
  if (file.empty()) {
    io::read_bag(path);  // or it only has the name of one, and says so
    throw Error("is a bag: say what its topics mean by a mapping (`--mapping FILE`); `palpate info` suggests one", path.string());
  }
  io::BagMapping mapping = io::read_mapping(file);
  for (const io::MappedCamera& camera : mapping.cameras) check_noise(camera.like.noise.model, camera.noise_where);
  acquisition::FromStreams made = recording_of(io::read_bag(path), mapping);  // the bag's bytes are not kept beside those hashed below
  made.recording.warnings.insert(made.recording.warnings.end(), made.notes.begin(), made.notes.end());
  if (fs::is_regular_file(path, code))
    made.recording.input_hashes[path.filename().string()] = io::sha256_hex(io::read_file(path));
  return {std::move(made.recording), std::move(made.clocks)};
}

void check_loaded(Recording& recording, const std::string& lister) {
  const auto problems = io::check_recording(recording);
  if (!problems.empty()) {
    const std::string more =
        problems.size() > 1 ? fmt::format(" ({} more: {} lists them)", problems.size() - 1, lister) : std::string();
    throw Error(problems.front().what + more, problems.front().where);
  }
  warn_of_oddities(recording);
}

}  // namespace palpate
