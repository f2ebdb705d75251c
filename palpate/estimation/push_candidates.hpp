// SPDX-License-Identifier: Apache-2.0
// Where a robot could push next: places and directions on the rest surface that a round tool reaches and does not slip off.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::estimation {

/// What robot and object bear. Angles are between the push and the surface's inward normal.
struct PushLimits {
  double force_n = 50;                ///< the paper's
  double travel_m = 0.10;             ///< the paper's
  double pressure_over_young = 0.25;  ///< mean pressure under the tool; beyond about 0.3 no small-strain number is left
  double thickness_share = 0.2;       ///< travel, of the object's thickness along the push
  double tilt_rad = 0.55;             ///< a soft pad holds 31 degrees with a friction coefficient of 0.6
  double stick_length_m = 0.30;       ///< from the tip to the hand
  double hand_radius_m = 0.06;
  double flatness = 0.35;  ///< largest gap under the tool's rim, of its radius
};

struct PushCandidate {
  Vec3 contact_m = Vec3::Zero();    ///< on the rest surface
  Vec3 direction = -Vec3::UnitZ();  ///< unit length, into the object
  double thickness_m = 0;           ///< of the object along the push
};

struct CandidateOptions {
  PushLimits limits;
  int contacts = 24;  ///< places, spread evenly
  int tilts = 2;      ///< directions at each place besides the normal one
  std::uint64_t seed = 1;
  /// What the robot itself says about a push (joint limits, collisions); empty: geometry alone decides.
  std::function<bool(const Vec3& contact_m, const Vec3& direction)> reachable;
};

/// @throws Error naming the option that is out of range.
void check(const CandidateOptions& options);

/// Judges single pushes of a round tool (sphere or disc) against the limits that need no mechanics.
class PushSpace {
 public:
  /// @param scene  environment's planes; supports whose nodes `held_m` are
  /// @param held_m  places that supports hold: no tool gets there
  /// @throws Error when the tool is not round.
  PushSpace(const TriMesh& surface, const Recording& scene, Points held_m, const Tool& tool, CandidateOptions options);
  ~PushSpace();

  /// Fills thickness_m. @returns why this push is not possible (a stable word), empty where it is.
  std::string refusal(PushCandidate& candidate) const;

  /// Candidates spread over the surface, the same for the same seed. `refused` counts what was left out, by word.
  std::vector<PushCandidate> sample(std::map<std::string, int>* refused = nullptr) const;

 private:
  Vec3 mean_normal(const Vec3& contact_m) const;
  std::string geometric_refusal(PushCandidate& candidate) const;
  bool in_reach(const PushCandidate& candidate) const;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::estimation
