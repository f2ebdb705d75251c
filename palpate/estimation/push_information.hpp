// SPDX-License-Identifier: Apache-2.0
// Fisher information of pushes that nobody has made: steps are made up, and the fit's forward model and terms do the rest.
// Inner header of next_push.
#pragma once

#include <memory>
#include <optional>

#include "palpate/estimation/next_push.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {

class PushInformation {
 public:
  /// Two factorisations: one says how far each candidate gives way and so how hard it may be pushed, the other (the forward
  /// model's) has every candidate's loads as right-hand sides.
  PushInformation(const Recording& scene, const SimulatedObject& object, const std::string& tool,
                  const std::vector<PushCandidate>& candidates, const SensorPlan& sensors, const Knowledge& knowledge,
                  const RankOptions& options);
  ~PushInformation();

  std::size_t count() const;  ///< candidates that the supports carry
  int left_out() const;       ///< the others
  /// One entry a view and force level; empty where no view shows the place. `expected` is left open.
  std::vector<RatedPush> rate(std::size_t candidate);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Rays of `view` that the stick (radius `radius_m`, from the contact backwards) does not cover.
RayObservation without_stick(const RayObservation& view, const PushCandidate& candidate, double radius_m, double length_m);

/// Share of the surface around the tool, one to three radii from the contact, that a view shows: facing it (nothing: any
/// side), with none of the object in between, and with points that were seen beside it.
double seen_share(const geometry::TriangleTree& surface, const Points& seen_m, const std::optional<Vec3>& eye_m,
                  const PushCandidate& candidate, double radius_m, double spacing_m);

}  // namespace palpate::estimation
