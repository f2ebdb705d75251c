// SPDX-License-Identifier: Apache-2.0
// The door to the next best push: an object with its sensors in, pushes out, best first, each with the intervals that are to
// be expected after it. Works before the first touch too.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/estimation/next_push.hpp"

namespace palpate {

struct SuggestOptions {
  estimation::PushGoal goal = estimation::PushGoal::both;
  /// With the robot's limits. Where `reachable` is empty and the recording has a robot, its joints' limits decide.
  estimation::CandidateOptions candidates;
  std::string tip_link;                           ///< of that robot, z along the push; empty = found from the pushes' joints
  std::vector<estimation::PushCandidate> only;    ///< pushes to be rated, instead of sampled ones
  std::string tool;                               ///< of the recording; empty = its only one
  double young_modulus_pa = 2e4;                  ///< guess before the first touch
  std::vector<DepthFrame> cameras;                ///< empty = those of the recording; pixels are not looked at
  std::optional<estimation::SensorPlan> sensors;  ///< errors of force and travel; nothing = those of the last push
  int viewpoints = 0;                             ///< further places of the first camera, around the object
  int threads = 1;
};

struct Viewpoint {
  std::string name;
  std::optional<Pose> T_base_camera;  ///< nothing: a cloud, from wherever it came
};

/// All that does not change from push to push: mesh, sensors, candidates.
struct PushScene {
  Recording object;  ///< as it is simulated; no pushes
  estimation::SimulatedObject simulated;
  std::string tool;
  estimation::SensorPlan sensors;
  std::vector<Viewpoint> viewpoints;  ///< of sensors.views
  std::vector<estimation::PushCandidate> candidates;
  std::map<std::string, int> refused;  ///< places and directions that were tried and left out, by reason
  std::vector<std::string> warnings;   ///< what was assumed
};

/// Why what is known so far cannot be built on: a tool that slipped or an object that moved is not in the model that pushes are
/// ranked by, and its intervals are those of that model. Empty: it can.
std::string why_not_to_build_on(const Identification& so_far);

/// @throws Error where the shape cannot be simulated, the tool is not round, or no candidate is left.
PushScene prepare_pushes(const Recording& recording, const SuggestOptions& options, const OnProgress& progress = {});

/// @param so_far  what the pushes until now gave; nullptr: before the first touch
estimation::PushRanking suggest(const PushScene& scene, const Identification* so_far, const SuggestOptions& options,
                                const OnProgress& progress = {});

}  // namespace palpate
