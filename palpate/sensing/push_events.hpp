// SPDX-License-Identifier: Apache-2.0
// What happens during a push, told from force and tip pose: contact, settling, slip, loss of contact. Each is a pure
// function of samples, so that a robot can ask while it moves and an estimator afterwards.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

/// Force of the tool on the object and position of its tip at one time.
struct ContactSample {
  double time_s = 0;
  Vec3 force_n = Vec3::Zero();
  Vec3 tip_m = Vec3::Zero();
};

struct ContactOptions {
  double threshold_n = 0.3;   ///< force along the push that means contact, at least
  double noise_factor = 5.0;  ///< and at least this many standard deviations of the samples in free air
  int confirm_samples = 3;    ///< in a row
};
void check(const ContactOptions& options);

/// First sample of the first run that is in contact.
/// @param free_air_std_n  standard deviation of the force along the push without contact
std::optional<std::size_t> find_contact(std::span<const ContactSample> samples, const Vec3& direction, double free_air_std_n,
                                        const ContactOptions& options = {});

struct SettlingOptions {
  double rate_n_s = 0.05;          ///< settled when |dF/dt| is below this ...
  double relative_rate_s = 0.005;  ///< ... or below this share of the force a second, whichever is more
  double window_s = 0.5;           ///< over which the rate is fitted
};
void check(const SettlingOptions& options);

struct Settling {
  bool settled = false;
  double rate_n_s = 0;  ///< slope of the force along the push over the window
  double rate_std_n_s = 0;
  double force_n = 0;  ///< mean over the window
};

/// Looks at the last window of the samples. Not settled when they do not span it. A rate counts as small when it is so
/// within two of its standard deviations, so that noise alone never settles a force that still creeps.
Settling settling(std::span<const ContactSample> samples, const Vec3& direction, const SettlingOptions& options = {});

struct SlipOptions {
  double tangential_m = 0.002;  ///< sideways motion of the tip beyond the line of the push
  double friction_limit = 0.8;  ///< tangential over normal force: beyond it the tool cannot stick
  double force_drop = 0.2;      ///< share of the force lost while the tool moved on ...
  double deeper_m = 0.001;      ///< ... by this much: an arm that repeats to a millimetre moves a force up and down as well
  double least_force_n = 0.5;   ///< below it, ratios say nothing
  double noise_n = 0;           ///< standard deviation of a reading: a loss within six of them is none
};
void check(const SlipOptions& options);

enum class PushEvent { none, slip_sideways, slip_friction, force_drop, contact_lost };

/// What the newest sample shows against those of the push before it (the first one is the contact). `contact_lost` when the
/// force along the push fell under `lost_n`.
PushEvent watch(std::span<const ContactSample> push, const Vec3& direction, double lost_n, const SlipOptions& options = {});

const char* to_words(PushEvent event);

}  // namespace palpate::sensing
