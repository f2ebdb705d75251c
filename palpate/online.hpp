// SPDX-License-Identifier: Apache-2.0
// The door for a robot at work: one step after another in, what E and nu are by now out.
#pragma once

#include <optional>

#include "palpate/estimation/growing_fit.hpp"
#include "palpate/identify.hpp"

namespace palpate {

/// What is estimated while the robot pushes. Every step starts where the last one ended, and nothing is solved for anew that
/// need not be. When all steps are in, `answer` is what `identify` says of the whole recording.
///
///   OnlineEstimator estimator(scene);                  // object, supports, tools, cameras, priors: a recording without pushes
///   estimator.begin(push);                             // its name, site and priors
///   while (robot.pushes()) show(estimator.add(step));  // loads and observations
///   Identified final = estimator.answer();
class OnlineEstimator {
 public:
  /// @param scene  pushes in it, if any, are taken as made already
  /// @throws Error as `identify` does for options that are out of range
  explicit OnlineEstimator(const Recording& scene, const IdentifyOptions& options = {});

  /// A new push: its name, site and priors; steps in it are taken in one by one, without an estimate in between.
  /// @throws Error when a push of this name was made
  void begin(const Push& push);

  /// One more step of the push. Until a load and an observation have been seen there are no parameters.
  /// @returns as estimation::GrowingFit::update: parameters with intervals, nuisances, verdicts; no figures
  /// @throws Error when no push was begun, or the step is one that `identify` would refuse; the step is then not taken in
  const Identification& add(const Step& step, const OnProgress& progress = {});

  const Identification& estimate() const { return estimate_; }  ///< after the last step
  const Recording& recording() const { return recording_; }     ///< all so far

  /// What `identify` says of all so far: with the mesh's error, checks of the parts and figures.
  Identified answer(const OnProgress& progress = {}) const;

 private:
  bool new_contact(const Step& step) const;
  void build(const OnProgress& progress);
  void take_in(const Recording& part);
  std::string camera_of(const DepthFrame& frame);

  struct SeenFrom {
    Camera camera;
    Pose T_base_camera = Pose::Identity();
    std::string name;
    bool again = false;  ///< a camera of these intrinsics was here before
  };
  IdentifyOptions options_;
  Recording recording_;   // as given, with all steps
  Recording light_;       // the same without images and points, which are in inputs_: this one is copied at every step
  Recording simulated_;   // light_ with the object and its contacts as they are solved
  std::optional<estimation::SimulatedObject> object_;
  estimation::Inputs inputs_;
  std::vector<SeenFrom> cameras_;  // one a frame
  estimation::GrowingFit fit_;
  Identification estimate_;
};

}  // namespace palpate
