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

struct Identified;

struct SuggestOptions {
  estimation::PushGoal goal = estimation::PushGoal::both;
  /// With the robot's limits. Where `reachable` is empty and the recording has a robot, its joints' limits decide.
  estimation::CandidateOptions candidates;
  std::string tip_link;                           ///< of that robot, z along the push; empty = found from the pushes' joints
  std::vector<estimation::PushCandidate> only;    ///< pushes to be rated, instead of sampled ones
  std::string tool;                               ///< of the recording; empty = its only one
  double young_modulus_pa = 2e4;                  ///< guess before the first touch
  std::vector<DepthFrame> cameras;                ///< empty = those of the recording; pixels are not looked at
  std::optional<estimation::SensorPlan> sensors;  ///< errors of force and travel; nothing = as pushes stated them last
  int viewpoints = 0;                             ///< further places of the first camera, around the object
  int threads = 1;  ///< 0: as many as the machine has
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

/// What pushes after a fit are planned on: the object as it was fitted (mesh, regions, supports, priors), with the cameras, sensors and
/// robot of the recording. From the recording alone a shape that views showed would be made anew, and regions that the fit chose
/// would be missing.
/// @param object  Identified::object, or the recording in a result's model/
Recording as_fitted(Recording object, const Recording& recording);

/// @throws Error where the shape cannot be simulated, the tool is not round, or no candidate is left.
PushScene prepare_pushes(const Recording& recording, const SuggestOptions& options, const OnProgress& progress = {});

/// @param so_far  what the pushes until now gave; nullptr: before the first touch
estimation::PushRanking suggest(const PushScene& scene, const Identification* so_far, const SuggestOptions& options,
                                const OnProgress& progress = {});

/// "push at (0.6000 0.0100 0.1500) along (+0.00 +0.00 -1.00) up to 8.20 N (about 9.10 mm), seen by camera 2"
std::string push_words(const estimation::RatedPush& push, const PushScene& scene);

/// Where `nu_not_determined` was said: its message gets the push that would narrow nu the most, with the interval that it
/// promises. Pushes are compared on the mesh that was fitted with. Nothing is added where no push can be planned (a tool that is
/// not round, say) or where what is known cannot be built on; then `palpate suggest` says why.
/// @param recording  that was identified: its cameras and sensors are those of the next push
void name_push_for_poisson(const Recording& recording, Identified& found, int threads = 1, const OnProgress& progress = {});

}  // namespace palpate
