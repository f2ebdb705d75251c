// SPDX-License-Identifier: Apache-2.0
#include "palpate/recording_oddities.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "palpate/io/recording.hpp"
#include "palpate/sensing/arm_mask.hpp"
#include "palpate/sensing/depth_noise.hpp"
#include "palpate/sensing/kinematics.hpp"
#include "palpate/sensing/robot_mask.hpp"

namespace palpate {
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

}  // namespace palpate
