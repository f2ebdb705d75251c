// SPDX-License-Identifier: Apache-2.0
// From a bag to a recording: `io` reads messages and mapping, `acquisition` makes steps of them. Only a front may know both.
#include "cli/bag_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "cli/mistyped.hpp"
#include "cli/paths.hpp"
#include "palpate/acquisition/from_streams.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/bag_mapping.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/sensing/arm_mask.hpp"
#include "palpate/sensing/depth_noise.hpp"
#include "palpate/sensing/kinematics.hpp"
#include "palpate/sensing/robot_mask.hpp"

namespace palpate::cli {

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
  const auto meant = did_you_mean(model, names);
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

std::string to_words(const acquisition::ClockOffset& clock) {
  if (!clock.usable) return "not to be told, nothing taken off";
  const double taken_s = acquisition::believed_offset_s(clock);
  return fmt::format("{:+.1f} +- {:.1f} ms against the arm's (correlation {:.2f}), {}", 1e3 * clock.offset_s,
                     1e3 * clock.std_s, clock.correlation,
                     taken_s == 0 ? std::string("no evidence of any: nothing taken off")
                                  : fmt::format("{:+.1f} ms taken off", 1e3 * taken_s));
}

LoadedRecording load_recording(const fs::path& path, const fs::path& given) {
  must_exist(path, "a recording is a folder with recording.yaml in it, or a bag (docs/recording-format.md)");
  if (!io::is_bag(path)) {
    if (!given.empty()) throw Error("is a recording; only a bag needs a mapping", path.string());
    Recording recording = io::read_recording_unchecked(path);
    check_noise(recording, path);
    return {std::move(recording), {}};
  }
  const fs::path file = given.empty() ? mapping_of(path) : given;
  if (file.empty()) {
    io::read_bag(path);  // or it only has the name of one, and says so
    throw Error("is a bag: say what its topics mean with --mapping FILE; `palpate info` suggests one", path.string());
  }
  io::BagMapping mapping = io::read_mapping(file);
  for (const io::MappedCamera& camera : mapping.cameras) check_noise(camera.like.noise.model, camera.noise_where);
  acquisition::FromStreams made = recording_of(io::read_bag(path), mapping);  // the bag's bytes are not kept beside those hashed below
  made.recording.warnings.insert(made.recording.warnings.end(), made.notes.begin(), made.notes.end());
  std::error_code code;
  if (fs::is_regular_file(path, code))
    made.recording.input_hashes[path.filename().string()] = io::sha256_hex(io::read_file(path));
  return {std::move(made.recording), std::move(made.clocks)};
}

namespace {

/// By the robot's description: nobody has done it.
bool is_to_be_masked(const Step& step) {
  return std::any_of(step.observations.begin(), step.observations.end(), [](const Observation& one) {
    const auto* frame = std::get_if<DepthFrame>(&one);
    return frame != nullptr && !frame->robot_is_masked;
  });
}

/// Images in which a part of the robot stays for want of a joint.
std::optional<std::string> unmasked(const Recording& recording) {
  if (!recording.robot || !sensing::has_shapes(*recording.robot)) return std::nullopt;
  const bool is_asked = std::any_of(recording.pushes.begin(), recording.pushes.end(), [](const Push& push) {
    return std::any_of(push.steps.begin(), push.steps.end(), [](const Step& step) {
      return !step.joints_rad.empty() && is_to_be_masked(step);
    });
  });
  if (!is_asked) return std::nullopt;
  const sensing::RobotMask mask(*recording.robot);
  for (const Index link : mask.shaped_links())
    if (const auto joint = mask.kinematics().missing_joint(link, recording.joint_names))
      return fmt::format("robot '{}': its joint '{}' is not among joint_names, so that the link '{}' and what else hangs on it is not masked "
                         "in depth images",
                         recording.robot->name, *joint, mask.kinematics().robot().links[std::size_t(link)].name);
  return std::nullopt;
}

/// Images of a pressed object in which nothing says what is arm, or what beside the stick is.
std::optional<std::string> nothing_masked(const Recording& recording) {
  const bool has_robot = recording.robot && sensing::has_shapes(*recording.robot);
  std::size_t bare = 0, stick_only = 0;
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps) {
      if (step.loads.empty() || (has_robot && !step.joints_rad.empty())) continue;
      std::size_t& count = sensing::sticks_of(recording, push, step).empty() ? bare : stick_only;
      for (const Observation& one : step.observations)
        if (const auto* frame = std::get_if<DepthFrame>(&one)) count += frame->mask.size() == 0 && !frame->robot_is_masked;
    }
  if (has_robot && bare + stick_only > 0)
    return fmt::format("robot '{}': {} images of the pressed object are of steps without joints_rad, and its description masks nothing in them, {}; "
                       "what is not masked is taken for the object: record the joints, or give 'mask'; where no arm is in the picture, say "
                       "robot_is_masked: true",
                       recording.robot->name, bare + stick_only,
                       bare == 0 ? std::string("only the stick is masked") : fmt::format("nor is the stick masked in {}", bare));
  if (bare == 0) return std::nullopt;
  return fmt::format("nothing masks the arm in {} images of the pressed object, and what is not masked is taken for the object: give 'mask', or "
                     "the robot's description with joints, or for a ball or disc the step's T_base_tip; where no arm is in the picture, say "
                     "robot_is_masked: true",
                     bare);
}

/// A robot whose description does not begin at the base stands elsewhere in the images, where its mask then lies.
std::optional<std::string> misplaced_robot(const Recording& recording) {
  if (!recording.robot || !sensing::has_shapes(*recording.robot)) return std::nullopt;
  constexpr double longest_stick_m = 0.5;
  const sensing::Kinematics kinematics(*recording.robot);
  double nearest_m = std::numeric_limits<double>::infinity();
  bool is_asked = false;
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps) {
      if (!step.T_base_tip || step.joints_rad.empty() || !is_to_be_masked(step)) continue;
      is_asked = true;
      for (const auto& pose : kinematics.known_link_poses(recording.joint_names, step.joints_rad))
        if (pose) nearest_m = std::min(nearest_m, (pose->translation() - step.T_base_tip->translation()).norm());
    }
  if (!is_asked || nearest_m < longest_stick_m) return std::nullopt;
  return fmt::format("robot '{}': by its description and the joints no link comes nearer to the tip (T_base_tip) than {:.2f} m, so that it is masked where it "
                     "is not; its root link '{}' must be the base frame of all poses (a UR controller's base is turned by 180 degrees about z from it)",
                     recording.robot->name, nearest_m, kinematics.robot().links[std::size_t(kinematics.root_link())].name);
}

/// The middle depth outside the mask; 0 where there is none.
double median_depth_m(const DepthFrame& frame) {
  std::vector<float> depths;
  const bool masked = frame.mask.size() == frame.depth_m.size();
  for (Eigen::Index i = 0; i < frame.depth_m.size(); ++i)
    if (frame.depth_m.data()[i] > 0 && !(masked && frame.mask.data()[i] != 0)) depths.push_back(frame.depth_m.data()[i]);
  if (depths.empty()) return 0;
  const auto middle = depths.begin() + std::ptrdiff_t(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

/// The D435's model is a parabola with its foot at 0.77 m: nearer, it grows, and the sensor does not.
std::optional<std::string> noise_of_farther(const Recording& recording) {
  constexpr double near_m = 0.5;
  std::size_t count = 0;
  double nearest_m = near_m;
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps)
      for (const Observation& one : step.observations) {
        const auto* frame = std::get_if<DepthFrame>(&one);
        if (frame == nullptr || frame->noise.model != "realsense_d435") continue;
        const double depth_m = median_depth_m(*frame);
        if (depth_m > 0 && depth_m < near_m) ++count, nearest_m = std::min(nearest_m, depth_m);
      }
  if (count == 0) return std::nullopt;
  DepthNoise noise;
  noise.model = "realsense_d435";
  return fmt::format("{} depth images are taken from {:.2f} m, where the noise model realsense_d435, which was measured from afar, states too much "
                     "({:.1f} mm; its least is at 0.77 m): take realsense_stereo, or constant with what `palpate info` measures",
                     count, nearest_m, 1000 * sensing::axial_sigma_m(noise, {.depth_m = nearest_m}));
}

}  // namespace

void warn_of_oddities(Recording& recording) {
  for (std::string& odd : io::odd_numbers(recording)) recording.warnings.push_back(std::move(odd));
  if (auto lack = unmasked(recording)) recording.warnings.push_back(std::move(*lack));
  if (auto lack = nothing_masked(recording)) recording.warnings.push_back(std::move(*lack));
  if (auto elsewhere = misplaced_robot(recording)) recording.warnings.push_back(std::move(*elsewhere));
  if (auto near = noise_of_farther(recording)) recording.warnings.push_back(std::move(*near));
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

Recording load_recording_unchecked(Session& session, const fs::path& path, const fs::path& mapping,
                                   std::vector<acquisition::ClockOffset>* clocks) {
  LoadedRecording loaded = load_recording(path, mapping);
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
