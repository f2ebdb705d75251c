// SPDX-License-Identifier: Apache-2.0
// Where in a long series of force and tip somebody pushed: from contact to its loss, and the times in between at which the
// tool stood still and the force had settled.
#pragma once

#include <vector>

#include "palpate/core/force_drift.hpp"
#include "palpate/core/streams.hpp"
#include "palpate/sensing/push_events.hpp"

namespace palpate::acquisition {

/// Force on the object (not tared) and tip, in the base frame, with the direction that the tool points in.
struct Track {
  std::vector<sensing::ContactSample> samples;  ///< times rise
  std::vector<Vec3> direction;                  ///< of each sample, unit length
};

struct ContactSpan {
  std::size_t begin = 0, end = 0;  ///< samples of the track, end excluded
  Vec3 tare_n = Vec3::Zero();
  ForceDrift drift;  ///< of the tare, to the free air after the push; zero where there is none, or `tare` is not before_contact
  double free_air_std_n = 0;         ///< of one sample, largest of the three axes
  std::size_t free_air_samples = 0;  ///< that made the tare
  Vec3 contact_m = Vec3::Zero();     ///< tip where the force began, its rise traced back to zero
  Vec3 direction = -Vec3::UnitZ();
};

/// Contact begins where the force along the push exceeds the plan's threshold and five standard deviations of the free air
/// before it, three samples in a row, while the tip comes nearer, and ends below half of that. What follows the first rise
/// that is beyond noise and a fifth of the threshold is no free air; one of less than about half the threshold within
/// `tare_s` passes for drift. Spans that are closer than `hold_s` are one. The free air after a push is `tare_s` of it once
/// the tip has left the contact, with the tool as it was: a heavy one that turns would pass for drift.
std::vector<ContactSpan> find_contacts(const Track& track, const StreamPlan& plan);

struct StillTime {
  double time_s = 0;
  bool settled = false;  ///< false: the force crept, beyond two standard deviations of its rate
};
/// Ends of the stretches of a span in which the tip stood still for `hold_s`.
std::vector<StillTime> find_still_times(const Track& track, const ContactSpan& span, const StreamPlan& plan);

}  // namespace palpate::acquisition
