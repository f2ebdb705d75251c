// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <string>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition {

double travel_offset_std_m(const PushOptions& o, double travel_sigma_m) { return std::hypot(0.5 * o.increment_m, travel_sigma_m); }

void check(const PushOptions& o) {
  const auto need = [](bool good, const char* field, const char* rule) {
    if (!good) throw Error(rule, std::string("PushOptions.") + field);
  };
  need(o.force_limit_n > 0, "force_limit_n", "must be positive");
  need(o.travel_limit_m > 0, "travel_limit_m", "must be positive");
  need(o.force_step_n > 0, "force_step_n", "must be positive");
  need(o.unloading_steps >= 0, "unloading_steps", "must not be negative");
  need(o.start_distance_m > 0, "start_distance_m", "must be positive");
  need(o.search_distance_m >= 0, "search_distance_m", "must not be negative");
  need(o.increment_m > 0 && o.increment_m <= 0.01, "increment_m", "must be positive and at most 10 mm");
  need(o.clearance_m > 0, "clearance_m", "must be positive");
  need(o.tool_length_m >= 0, "tool_length_m", "must not be negative");
  need(o.look_every_m > 0 && o.look_every_m <= 0.05, "look_every_m", "must be positive and at most 50 mm");
  need(o.obstacle_threshold_n > 0, "obstacle_threshold_n", "must be positive");
  need(o.blind_retreat_m > 0, "blind_retreat_m", "must be positive");
  need(o.approach_speed_m_s > 0, "approach_speed_m_s", "must be positive");
  need(o.push_speed_m_s > 0, "push_speed_m_s", "must be positive");
  need(o.sample_period_s > 0, "sample_period_s", "must be positive");
  need(o.free_air_samples >= 2, "free_air_samples", "must be at least 2");
  need(o.settling_timeout_s > o.settling.window_s, "settling_timeout_s", "must be longer than settling.window_s");
  need(o.contact_std_m >= 0, "contact_std_m", "must not be negative");
  need(o.changed_share >= 0, "changed_share", "must not be negative");
  sensing::check(o.contact);
  sensing::check(o.settling);
  sensing::check(o.slip);
}

PushOptions within(const RobotLimits& limits, PushOptions options) {
  check(limits);
  options.force_limit_n = std::min(options.force_limit_n, limits.force_n);
  options.travel_limit_m = std::min(options.travel_limit_m, limits.travel_m);
  options.approach_speed_m_s = std::min(options.approach_speed_m_s, limits.speed_m_s);
  options.push_speed_m_s = std::min(options.push_speed_m_s, limits.speed_m_s);
  return options;
}

bool is_at_a_limit(StopReason reason) {
  using enum StopReason;
  return reason == force_limit || reason == travel_limit || reason == robot_force_limit || reason == robot_travel_limit;
}

const char* to_words(StopReason reason) {
  switch (reason) {
    case StopReason::force_limit:
      return "force limit";
    case StopReason::travel_limit:
      return "travel limit";
    case StopReason::robot_force_limit:
      return "force limit of the robot";
    case StopReason::robot_travel_limit:
      return "travel limit of the robot";
    case StopReason::slip:
      return "slip";
    case StopReason::contact_lost:
      return "contact lost";
    case StopReason::no_contact:
      return "no contact";
    case StopReason::robot_limit:
      return "limit of the robot";
    case StopReason::obstacle:
      return "hit something on the way";
    case StopReason::moved:
      return "moved since the part that is recorded";
    case StopReason::user:
      break;
  }
  return "stopped by the user";
}

}  // namespace palpate::acquisition
