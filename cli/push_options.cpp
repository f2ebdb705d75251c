// SPDX-License-Identifier: Apache-2.0
#include "cli/push_options.hpp"

#include <fmt/format.h>

#include "cli/number_checks.hpp"
#include "palpate/core/error.hpp"

namespace palpate::cli {
namespace {

// Groups of the help: what everybody sets comes first, thresholds that are right for most sensors last.
constexpr const char* limits = "Limits of a push";
constexpr const char* motion = "Motion of a push (the defaults suit most robots)";
constexpr const char* thresholds = "Contact, settling and slip of a push (the defaults suit most force sensors)";

auto adder(CLI::App& app) {
  return [&app](const char* group, const char* name, auto& value, const char* words, const CLI::Validator& check) {
    app.add_option(name, value, words)->check(check)->capture_default_str()->group(group);
  };
}

}  // namespace

void add_push_limits(CLI::App& app, acquisition::PushOptions& push) {
  push.travel_limit_m = 0;
  const auto add = adder(app);
  add(limits, "--force-limit", push.force_limit_n, "stop at this force, N", positive_number());
  app.add_option("--travel-limit", push.travel_limit_m, "stop at this travel, m (default: of the object; of a driver's 0.1)")
      ->check(positive_number())
      ->group(limits);
  add(limits, "--unloading-steps", push.unloading_steps, "recorded on the way back, equally spaced in force", CLI::Range(0, 100));
  add(limits, "--contact-std", push.contact_std_m,
      "how well the contact point is known across the push, m: the standard deviation that the recording will state", number_from_zero());
}

void add_push_thresholds(CLI::App& app, acquisition::PushOptions& push) {
  const auto add = adder(app);
  add(motion, "--start-distance", push.start_distance_m, "before the expected contact, m: there the approach starts and the push ends",
      positive_number());
  add(motion, "--search-distance", push.search_distance_m, "beyond the expected contact, m: how far to look for it", number_from_zero());
  add(motion, "--increment", push.increment_m, "of the tip between two looks at the force, m (at most 0.01)", positive_number());
  add(motion, "--clearance", push.clearance_m,
      "of the tip around the object's box on its way between pushes, m: more than the tool's radius", positive_number());
  add(motion, "--tool-length", push.tool_length_m, "behind the tip, m: so much of the tool keeps out of that box, too", number_from_zero());
  add(motion, "--look-every", push.look_every_m, "of the tip between two looks at the force, on its way between pushes, m (at most 0.05)",
      positive_number());
  add(motion, "--blind-retreat", push.blind_retreat_m,
      "back along the tool, before and after the way to a push, where nobody knows how large the object is, m", positive_number());
  add(motion, "--approach-speed", push.approach_speed_m_s, "up to contact and away from the object, m/s", positive_number());
  add(motion, "--push-speed", push.push_speed_m_s, "in contact, m/s", positive_number());
  add(motion, "--sample-period", push.sample_period_s, "between two readings of the sensors, s", positive_number());
  add(motion, "--free-air-samples", push.free_air_samples, "readings before and after a push, for the force's zero and its noise",
      CLI::Range(2, 100000));

  add(thresholds, "--contact-threshold", push.contact.threshold_n, "force along the push that means contact, at least, N",
      positive_number());
  add(thresholds, "--contact-noise-factor",
      push.contact.noise_factor, "and at least this many standard deviations of the force in free air",
      number_from_zero());
  add(thresholds, "--contact-samples", push.contact.confirm_samples, "readings in a row that must say so", CLI::Range(1, 1000));
  add(thresholds, "--obstacle-threshold", push.obstacle_threshold_n,
      "change of the force on the way between pushes that means something is hit, at least, N; the contact threshold where that is more",
      positive_number());
  add(thresholds, "--settling-rate", push.settling.rate_n_s, "a step is recorded once its force changes by less, N/s ...",
      positive_number());
  add(thresholds, "--settling-relative-rate", push.settling.relative_rate_s, "... or by less than this share of it a second, 1/s",
      number_from_zero());
  add(thresholds, "--settling-window", push.settling.window_s, "over which that rate is fitted, and the force averaged, s",
      positive_number());
  add(thresholds, "--settling-timeout", push.settling_timeout_s,
      "a step that has not settled by then is recorded all the same, and named, s; longer than the window", positive_number());
  add(thresholds, "--slip-sideways", push.slip.tangential_m, "motion of the tip across the push that means slip, m", positive_number());
  add(thresholds, "--slip-friction", push.slip.friction_limit, "sideways force over force along the push that means slip",
      positive_number());
  add(thresholds, "--slip-force-drop", push.slip.force_drop, "share of the force whose loss means slip ...", CLI::Range(0.0, 1.0));
  add(thresholds, "--slip-deeper", push.slip.deeper_m, "... while the tip went deeper by this, m", number_from_zero());
  add(thresholds, "--slip-least-force", push.slip.least_force_n, "no slip is told below this force, or below the force step, N",
      number_from_zero());
  add(thresholds, "--changed-share", push.changed_share,
      "of the picture's pixels that may differ after a push, before it is said that the object did not come back", number_from_zero());
}

void add_force_step_option(CLI::App& app, acquisition::PushOptions& push) {
  push.force_step_n = 0;
  app.add_option("--force-step", push.force_step_n, "between recorded steps, N (default: of the object; of a driver's 2)")
      ->check(positive_number())
      ->group(limits);
}

void check_push_options(acquisition::PushOptions push) {
  if (!(push.travel_limit_m > 0)) push.travel_limit_m = acquisition::PushOptions{}.travel_limit_m;
  if (!(push.force_step_n > 0)) push.force_step_n = acquisition::PushOptions{}.force_step_n;
  acquisition::check(push);
}

void must_clear(const std::vector<Tool>& tools, const acquisition::PushOptions& push) {
  for (const Tool& tool : tools)
    if (push.clearance_m <= tool.radius_m)
      throw Error(fmt::format("{} m is not more than the radius of the tool '{}', {} m: on its way between pushes it would touch the object",
                              push.clearance_m, tool.name, tool.radius_m),
                  "--clearance");
}

}  // namespace palpate::cli
