// SPDX-License-Identifier: Apache-2.0
// Up to contact, and into the object until a limit says stop.
#include "palpate/acquisition/push_run.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <utility>

#include "palpate/acquisition/force_begin.hpp"
#include "palpate/sensing/push_events.hpp"

namespace palpate::acquisition {

void PushRun::approach() {
  std::vector<sensing::ContactSample> samples = std::move(approach_);  // of a touch that was lost again: what was felt before it
  double motion_m = options_.increment_m, fine_until_m = -options_.start_distance_m;
  std::optional<double> behind_at_first_m;
  while (at_m_ < options_.search_distance_m) {
    if (at_m_ > fine_until_m) motion_m = options_.increment_m;
    move_to(at_m_ + motion_m, options_.approach_speed_m_s);
    for (int i = 0; i < options_.contact.confirm_samples; ++i) {
      robot_.wait(options_.sample_period_s);
      samples.push_back(sample(robot_.read()));
    }
    const auto contact = sensing::find_contact(samples, plan_.direction, free_air_std_n_, options_.contact);
    if (!contact) {
      watch_aside(samples);
      const double now_m = behind_m(samples.back().tip_m);
      const double more_m = now_m - behind_at_first_m.value_or(now_m);
      if (more_m > much_behind_m()) stays_behind(more_m);
      if (!behind_at_first_m) behind_at_first_m = now_m;
      continue;
    }
    const double touched_n = along(samples.back().force_n);
    if (lengths_.is_hard_touch(touched_n, motion_m)) {  // back to where nothing was felt, and once more
      samples.resize(*contact);
      fine_until_m = at_m_ + options_.increment_m;
      move_to(at_m_ - motion_m, options_.approach_speed_m_s);
      look();
      motion_m = lengths_.after_hard_touch_m(touched_n, motion_m);
      continue;
    }
    touched(samples, *contact, motion_m);
    return;
  }
  throw Stopped{StopReason::no_contact, "no contact within " + std::to_string(1000 * options_.search_distance_m) +
                                            " mm beyond the expected surface"};
}

void PushRun::watch_aside(std::span<const sensing::ContactSample> samples) {
  const auto in_a_row = static_cast<std::size_t>(options_.contact.confirm_samples);
  if (samples.size() < in_a_row) return;
  // Since the tare the hand has moved; a stick's weight and the sensor's drift are felt, too.
  const double least_n = 2 * std::max({options_.obstacle_threshold_n, options_.contact.threshold_n, options_.contact.noise_factor * worst_axis_std_n_});
  Vec3 mean_n = Vec3::Zero();
  for (const sensing::ContactSample& one : samples.last(in_a_row)) {
    if (one.force_n.norm() < least_n) return;
    mean_n += one.force_n / double(in_a_row);
  }
  const double along_n = along(mean_n), aside_n = (mean_n - along_n * plan_.direction).norm();
  report_.highest_force_n = std::max(report_.highest_force_n, mean_n.norm());
  std::ostringstream words;
  words.precision(2);
  if (along_n < -aside_n)
    words << "the force grows against the push, to " << -along_n << " N: is its sign right? It is the force of the tool on the object, in the base frame";
  else
    words << aside_n << " N across the push are felt and " << along_n << " N along it: something stands beside the tool, or the force is not given in "
          << "the base frame";
  throw Stopped{StopReason::obstacle, words.str()};
}

void PushRun::stays_behind(double by_m) const {
  std::ostringstream words;
  words.precision(2);
  words << "the tip stays " << 1000 * by_m << " mm behind where it was sent: the arm yields, is blocked, or does not do what it is told";
  throw Stopped{StopReason::robot_limit, words.str()};
}

void PushRun::touched(const std::vector<sensing::ContactSample>& samples, std::size_t contact, double motion_m) {
  noticed_m_ = samples[contact].tip_m;
  // Encoders are absolute: what goes on counts from the zero that the recorded travels have.
  report_.contact_m = recorded_.contact_m.value_or(noticed_m_);
  begins_late_ = true;
  late_of_ = 0;
  approach_.assign(samples.begin(), samples.begin() + std::ptrdiff_t(contact));
  history_.assign(samples.begin() + std::ptrdiff_t(contact), samples.end());
  touched_at_m_ = at_m_;
  lengths_.touched(at_m_, motion_m);
}

Stopped PushRun::press() {
  constexpr int touches = 5;
  for (int touch = 1;; ++touch) {
    approach();
    try {
      return rise();
    } catch (const Stopped& stop) {
      const bool hardly_touched = !loaded_ && recorded_.force_n == 0 && top_n_ < 2 * options_.force_step_n;
      if (stop.reason != StopReason::contact_lost || !hardly_touched || touch == touches) throw;
    }
  }
}

Stopped PushRun::rise() {
  const bool top_recorded = top_is_recorded();
  double target = std::max(options_.force_step_n, recorded_.force_n + options_.force_step_n);
  if (top_recorded) target = options_.force_limit_n;
  for (;;) {
    const RobotState state = robot_.read();
    const double now = pressing(state);
    report_.highest_force_n = std::max(report_.highest_force_n, now);
    report_.deepest_m = std::max(report_.deepest_m, travel(state));
    if (lengths_.is_far_beyond(now, at_m_)) {
      move_to(at_m_ - lengths_.take_back_m(now), options_.push_speed_m_s);
      robot_.wait(options_.sample_period_s);
      recorded_at_m_.reset();  // the arm comes to no place twice
      continue;
    }
    top_n_ = std::max(top_n_, now);
    if (recorded_.contact_m && now >= step_n()) begin_where_the_force_began();  // as early as in the part that is recorded
    if (now >= options_.force_limit_n) {
      end_rise(top_recorded);
      return at_force_limit();
    }
    if (is_at_travel_limit(state)) {
      end_rise(top_recorded);
      return at_travel_limit();
    }
    if (now >= std::min(target, options_.force_limit_n)) {
      // The motion that got there was picked for its own error, too: the tip stands deeper than the encoders say more often
      // than not. Of one more motion nothing is known yet.
      if (has_room_for_one_more(state)) {
        advance(state);
        if (lengths_.is_far_beyond(along(history_.back().force_n), at_m_)) continue;
      }
      target += options_.force_step_n;
      if (!is_at_travel_limit(robot_.read())) settle_and_record(false);  // else as the last one
      continue;
    }
    advance(state);
  }
}

Stopped PushRun::at_force_limit() const {
  if (options_.force_limit_n == asked_.force_limit_n) return {StopReason::force_limit, "the force reached its limit"};
  std::ostringstream words;
  words << "the force reached the robot's own limit of " << options_.force_limit_n << " N; " << asked_.force_limit_n << " N were asked for";
  return {StopReason::robot_force_limit, words.str()};
}

Stopped PushRun::at_travel_limit() const {
  if (options_.travel_limit_m == asked_.travel_limit_m) return {StopReason::travel_limit, "the travel reached its limit"};
  std::ostringstream words;
  words << "the travel reached the robot's own limit of " << 1000 * options_.travel_limit_m << " mm; " << 1000 * asked_.travel_limit_m
        << " mm were asked for";
  return {StopReason::robot_travel_limit, words.str()};
}

double PushRun::late_m(double travel_m) {
  if (!begins_late_ || recorded_.contact_m) return 0;
  if (late_of_ == history_.size()) return late_m_;
  late_of_ = history_.size();
  std::vector<sensing::ContactSample> samples = approach_;
  samples.insert(samples.end(), history_.begin(), history_.end());
  const auto found_m = [&](double increment_m) {
    const ForceBeginSearch search{options_.search_distance_m, increment_m, increment_m};
    return std::max(0.0, force_began_before_m(samples, noticed_m_, plan_.direction, search));
  };
  // Roughly, until the limit is near.
  late_m_ = found_m(5 * options_.increment_m);
  if (travel_m + late_m_ + 4 * options_.increment_m >= options_.travel_limit_m) late_m_ = found_m(options_.increment_m);
  return late_m_;
}

double PushRun::travel_left_m(const RobotState& state) {
  const double sent_m = options_.travel_limit_m + much_behind_m() - (at_m_ - touched_at_m_);
  if (sent_m <= 0) stays_behind(at_m_ - touched_at_m_ - travel(state));
  return std::min(sent_m, options_.travel_limit_m - gone_m(state));
}

void PushRun::advance(const RobotState& state) {
  const double from_m = at_m_;
  move_to(at_m_ + std::min(next_m(state), travel_left_m(state)), options_.push_speed_m_s);
  robot_.wait(options_.sample_period_s);
  history_.push_back(sample(robot_.read()));
  lengths_.moved(at_m_ - from_m, along(history_.back().force_n) - pressing(state));
  watch_out();
}

void PushRun::watch_out() {
  // The limit is one of what presses. What the tool drags at aside, friction that it sticks by allows for; no more than that.
  const double most_n = std::hypot(1, options_.slip.friction_limit) * options_.force_limit_n + 5 * worst_axis_std_n_;
  if (const Vec3& now_n = history_.back().force_n; now_n.norm() > most_n && along(now_n) < options_.force_limit_n) {
    report_.highest_force_n = std::max(report_.highest_force_n, now_n.norm());
    std::ostringstream words;
    words.precision(3);
    words << "the tool is dragged aside with " << (now_n - along(now_n) * plan_.direction).norm() << " N, beyond what the force limit allows";
    throw Stopped{StopReason::slip, words.str()};
  }
  // Below the first step, the arm's own repeat error moves the force of a soft object by more than slip would.
  sensing::SlipOptions slip = options_.slip;
  slip.least_force_n = std::max(slip.least_force_n, step_n());
  slip.noise_n = std::max(slip.noise_n, worst_axis_std_n_);
  const sensing::PushEvent event = sensing::watch(history_, plan_.direction, lost_n(), slip);
  if (event == sensing::PushEvent::none) return;
  throw Stopped{event == sensing::PushEvent::contact_lost ? StopReason::contact_lost : StopReason::slip,
                sensing::to_words(event)};
}

}  // namespace palpate::acquisition
