// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/motion_lengths.hpp"

#include <algorithm>
#include <numbers>

namespace palpate::acquisition {

MotionLengths::MotionLengths(const PushOptions& options)
    : options_(options), finest_m_(options.increment_m), first_m_(options.increment_m), longest_m_(options.increment_m) {}

void MotionLengths::state_noise(double force_std_n, double travel_sigma_m) {
  force_std_n_ = force_std_n;
  travel_sigma_m_ = travel_sigma_m;
}

double MotionLengths::step_n() const { return std::min(options_.force_step_n, options_.force_limit_n); }

// Far less than any increment that is sensible, and about what arms resolve.
double MotionLengths::shortest_m() const { return std::min(1e-5, options_.increment_m); }

// Motions shorter than what the arm repeats to would tell nothing.
bool MotionLengths::feels_its_way() const { return travel_sigma_m_ <= options_.increment_m / 16; }

bool MotionLengths::is_hard_touch(double force_n, double motion_m) const {
  // A step; of two, the second may be of the arm's own error.
  const double steps = feels_its_way() ? 1 : 2;
  return force_n > std::min(steps * options_.force_step_n, options_.force_limit_n) && motion_m > shortest_m();
}

double MotionLengths::after_hard_touch_m(double force_n, double motion_m) const {
  return std::max(shortest_m(), motion_m * std::min(0.5, 0.25 * step_n() / force_n));
}

void MotionLengths::touched(double at_m, double motion_m) {
  touched_at_m_ = at_m;
  finest_m_ = last_m_ = motion_m;
  risen_n_m_ = sure_risen_n_m_ = 0;
  // How stiff it is no one knows yet.
  first_m_ = std::min(motion_m, feels_its_way() ? std::max(shortest_m(), options_.increment_m / 16) : options_.increment_m);
}

void MotionLengths::moved(double length_m, double risen_n) {
  last_m_ = length_m;
  finest_m_ = std::min(finest_m_, std::max(shortest_m(), length_m));
  risen_n_m_ = risen_n / length_m;
  const double force_std_n = std::numbers::sqrt2 * force_std_n_, length_std_m = std::numbers::sqrt2 * travel_sigma_m_;
  sure_risen_n_m_ = (risen_n - 5 * force_std_n) / (length_m + 3 * length_std_m);
}

double MotionLengths::stiffness_n_m(const Seen& seen) const {
  const double so_far = seen.force_n / std::max(seen.travel_m, finest_m_);
  return sure_risen_n_m_ > so_far ? risen_n_m_ : so_far;
}

// What noise and the arm's repeat error cannot have made.
double MotionLengths::sure_stiffness_n_m(const Seen& seen) const {
  const double so_far = (seen.force_n - 5 * force_std_n_) / (std::max(seen.travel_m, finest_m_) + 3 * travel_sigma_m_);
  return std::max(sure_risen_n_m_, so_far);
}

double MotionLengths::next_m(const Seen& seen, double at_m) const {
  double length_m = for_steps_m(seen, step_n());
  // A tenth beyond the limit is still the limit; more is not risked, even if the object is twice as stiff from here on.
  const double beyond_n = std::min(0.5 * step_n(), 0.1 * options_.force_limit_n);
  const double room_n = options_.force_limit_n + beyond_n - seen.force_n;
  if (sure_stiffness_n_m(seen) * options_.increment_m > room_n)
    length_m = std::min(length_m, 0.5 * room_n / stiffness_n_m(seen));
  // Not farther than since the touch: where the object is linear the force is then doubled at most.
  length_m = std::min({length_m, longest_m_, std::max(first_m_, at_m - touched_at_m_)});
  return std::max(shortest_m(), length_m);
}

double MotionLengths::back_m(const Seen& seen, double between_n) const { return for_steps_m(seen, between_n); }

// An increment, or where that would change the force by more than a step, a quarter of a step.
double MotionLengths::for_steps_m(const Seen& seen, double between_n) const {
  if (!(sure_stiffness_n_m(seen) * options_.increment_m > between_n)) return options_.increment_m;
  return std::min(options_.increment_m, std::max(shortest_m(), 0.25 * between_n / stiffness_n_m(seen)));
}

bool MotionLengths::is_far_beyond(double force_n, double at_m) const {
  return force_n > 1.5 * options_.force_limit_n && at_m > touched_at_m_ && last_m_ > 1.01 * shortest_m();
}

double MotionLengths::take_back_m(double force_n) {
  const double length_m = last_m_;
  longest_m_ = last_m_ = after_hard_touch_m(force_n, length_m);
  return length_m;
}

}  // namespace palpate::acquisition
