// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/fresh_readings.hpp"

#include <cmath>
#include <sstream>

#include "palpate/core/error.hpp"

namespace palpate::acquisition {
namespace {

constexpr double patience_s = 2;
constexpr int blind_motions = 2;  // a clock that only waiting moves on has not stopped

}  // namespace

RobotState FreshReadings::read() {
  const bool must_be_new = read_at_s_ && (waited_ || motions_ > blind_motions);
  for (double since_s = 0;; since_s += wait_s_) {
    RobotState state = robot_.read();
    if (!std::isfinite(state.time_s)) throw Error("time_s: is not finite", "robot, read");
    if (read_at_s_ && state.time_s < *read_at_s_) throw Error("time_s: the clock must not go back", "robot, read");
    if (!must_be_new || state.time_s > *read_at_s_) {
      read_at_s_ = state.time_s;
      waited_ = false;
      motions_ = 0;
      return state;
    }
    if (since_s >= patience_s) {
      std::ostringstream words;
      words << "time_s: stands at " << state.time_s << " s while the robot waits and moves; is the sensor still connected, and is every reading "
            << "handed on with the time at which it was taken?";
      throw Error(words.str(), "robot, read");
    }
    robot_.wait(wait_s_);
  }
}

Motion FreshReadings::move(const Pose& T_base_tip, double speed_m_s) {
  const Motion motion = robot_.move(T_base_tip, speed_m_s);
  if (motion == Motion::done) ++motions_;
  return motion;
}

void FreshReadings::wait(double duration_s) {
  robot_.wait(duration_s);
  waited_ = true;
}

double FreshReadings::travel_sigma_m() const {
  const double sigma_m = robot_.travel_sigma_m();
  if (!(sigma_m > 0) || !std::isfinite(sigma_m)) throw Error("must be positive", "robot, travel_sigma_m");
  return sigma_m;
}

}  // namespace palpate::acquisition
