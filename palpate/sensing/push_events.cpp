// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/push_events.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate::sensing {
namespace {

void need(bool good, const char* where, const char* rule) {
  if (!good) throw Error(rule, where);
}

Vec3 unit(const Vec3& direction) {
  need(std::abs(direction.norm() - 1) < 1e-6, "direction", "must have unit length");
  return direction;
}

}  // namespace

void check(const ContactOptions& o) {
  need(o.threshold_n > 0, "ContactOptions.threshold_n", "must be positive");
  need(o.noise_factor >= 0, "ContactOptions.noise_factor", "must not be negative");
  need(o.confirm_samples >= 1, "ContactOptions.confirm_samples", "must be at least 1");
}
void check(const SettlingOptions& o) {
  need(o.rate_n_s > 0, "SettlingOptions.rate_n_s", "must be positive");
  need(o.relative_rate_s >= 0, "SettlingOptions.relative_rate_s", "must not be negative");
  need(o.window_s > 0, "SettlingOptions.window_s", "must be positive");
}
void check(const SlipOptions& o) {
  need(o.tangential_m > 0, "SlipOptions.tangential_m", "must be positive");
  need(o.friction_limit > 0, "SlipOptions.friction_limit", "must be positive");
  need(o.force_drop > 0 && o.force_drop <= 1, "SlipOptions.force_drop", "must be in (0, 1]");
  need(o.least_force_n >= 0, "SlipOptions.least_force_n", "must not be negative");
  need(o.noise_n >= 0, "SlipOptions.noise_n", "must not be negative");
}

std::optional<std::size_t> find_contact(std::span<const ContactSample> samples, const Vec3& direction, double free_air_std_n,
                                        const ContactOptions& options) {
  check(options);
  const Vec3 along = unit(direction);
  need(free_air_std_n >= 0, "free_air_std_n", "must not be negative");
  const double threshold = std::max(options.threshold_n, options.noise_factor * free_air_std_n);
  int run = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    run = samples[i].force_n.dot(along) > threshold ? run + 1 : 0;
    if (run == options.confirm_samples) return i + 1 - std::size_t(run);
  }
  return std::nullopt;
}

Settling settling(std::span<const ContactSample> samples, const Vec3& direction, const SettlingOptions& options) {
  check(options);
  const Vec3 along = unit(direction);
  Settling result;
  if (samples.empty()) return result;
  const double end = samples.back().time_s;
  std::size_t first = samples.size();
  while (first > 0 && samples[first - 1].time_s >= end - options.window_s * (1 + 1e-9)) --first;
  const auto window = samples.subspan(first);
  const double count = double(window.size());
  double time = 0, force = 0;
  for (const ContactSample& s : window) {
    time += s.time_s / count;
    force += s.force_n.dot(along) / count;
  }
  double tt = 0, tf = 0;
  for (const ContactSample& s : window) {
    tt += (s.time_s - time) * (s.time_s - time);
    tf += (s.time_s - time) * (s.force_n.dot(along) - force);
  }
  result.force_n = force;
  // The window must be spanned, and a slope with an error needs three samples.
  if (window.size() < 3 || end - window.front().time_s < 0.8 * options.window_s || !(tt > 0)) return result;
  result.rate_n_s = tf / tt;
  double rest = 0;
  for (const ContactSample& s : window) {
    const double miss = s.force_n.dot(along) - force - result.rate_n_s * (s.time_s - time);
    rest += miss * miss;
  }
  result.rate_std_n_s = std::sqrt(rest / (count - 2) / tt);
  const double limit = std::max(options.rate_n_s, options.relative_rate_s * std::abs(force));
  result.settled = std::abs(result.rate_n_s) + 2 * result.rate_std_n_s < limit;
  return result;
}

PushEvent watch(std::span<const ContactSample> push, const Vec3& direction, double lost_n, const SlipOptions& options) {
  check(options);
  const Vec3 along = unit(direction);
  if (push.size() < 2) return PushEvent::none;
  const ContactSample& now = push.back();
  const double normal = now.force_n.dot(along);
  if (normal < lost_n) return PushEvent::contact_lost;
  const Vec3 way = now.tip_m - push.front().tip_m;
  if ((way - along.dot(way) * along).norm() > options.tangential_m) return PushEvent::slip_sideways;
  if (normal > options.least_force_n && (now.force_n - normal * along).norm() > options.friction_limit * normal)
    return PushEvent::slip_friction;
  // A force that falls while the tool goes deeper: something gave way.
  double highest = 0, depth_there = 0;
  for (const ContactSample& s : push) {
    const double force = s.force_n.dot(along);
    if (force > highest) {
      highest = force;
      depth_there = along.dot(s.tip_m - push.front().tip_m);
    }
  }
  const bool deeper = along.dot(way) > depth_there + options.deeper_m - 1e-9;
  // The highest of many readings is high by chance, too, and the one that looks like a loss is low.
  const double loss_n = std::max(options.force_drop * highest, 6 * options.noise_n);
  if (highest > options.least_force_n && deeper && normal < highest - loss_n) return PushEvent::force_drop;
  return PushEvent::none;
}

const char* to_words(PushEvent event) {
  switch (event) {
    case PushEvent::slip_sideways:
      return "the tip moved sideways";
    case PushEvent::slip_friction:
      return "the tangential force exceeds what friction can hold";
    case PushEvent::force_drop:
      return "the force fell while the tool went deeper";
    case PushEvent::contact_lost:
      return "contact was lost";
    case PushEvent::none:
      break;
  }
  return "nothing";
}

}  // namespace palpate::sensing
