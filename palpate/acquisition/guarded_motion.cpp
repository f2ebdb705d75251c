// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/guarded_motion.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "palpate/acquisition/ways_around.hpp"

namespace palpate::acquisition {

GuardedMotion::GuardedMotion(Robot& robot, const PushOptions& options, std::function<void()> ask_user)
    : robot_(robot), options_(options), ask_user_(std::move(ask_user)), here_(robot.read().T_base_tip) {}

void GuardedMotion::listen() {
  const int count = std::max(10, options_.contact.confirm_samples);
  Vec3 sum = Vec3::Zero(), squares = Vec3::Zero();
  for (int i = 0; i < count; ++i) {
    ask_user_();
    robot_.wait(options_.sample_period_s);
    const RobotState state = robot_.read();
    sum += state.force_n;
    squares += state.force_n.cwiseAbs2();
    R_before_ = state.T_base_tip.linear();
  }
  before_n_ = sum / count;
  std_n_ = std::sqrt((squares / count - before_n_.cwiseAbs2()).cwiseMax(0.0).mean());
}

// As it is read: where a tip's roll is free, arms turn it on straight motions, too.
double GuardedMotion::turned_rad(const RobotState& state) const {
  return Eigen::Quaterniond(state.T_base_tip.linear()).angularDistance(Eigen::Quaterniond(R_before_));
}

bool GuardedMotion::is_felt(const RobotState& state) const {
  // A bias of the sensor turns with the hand; weight beside it may hide half of it.
  const double turns_n = 2 * turned_rad(state) * before_n_.norm();
  return (state.force_n - before_n_).norm() >
         turns_n + std::max({options_.obstacle_threshold_n, options_.contact.threshold_n, options_.contact.noise_factor * std_n_});
}

void GuardedMotion::watch(const Leaving& leaving, double gone_m) {
  for (int sample = 1;; ++sample) {
    const RobotState state = robot_.read();
    const Vec3 change_n = state.force_n - before_n_;
    if (!is_felt(state)) {
      constexpr double little_rad = 0.05;
      if (turned_rad(state) > little_rad) listen();
      return;
    }
    constexpr double along = 0.3;  // what was pressed leaves along the motion, friction beside it
    const bool falls = change_n.dot(motion_) > along * change_n.norm();
    if (gone_m <= leaving.within_m && (leaving.is_pressed || falls)) {
      before_n_ = state.force_n;
      return;
    }
    if (sample >= options_.contact.confirm_samples) hit(change_n, leaving);
    robot_.wait(options_.sample_period_s);
  }
}

void GuardedMotion::hit(const Vec3& change_n, const Leaving& leaving) {
  robot_.stop();
  const Vec3 at_m = robot_.read().T_base_tip.translation();
  double back_m = 0;
  while (!trail_.empty() && back_m < options_.clearance_m) {
    const Pose back = trail_.back();
    if (leaving.is_pressed && (back.translation() - from_m_).norm() <= leaving.within_m) break;  // the object is there
    trail_.pop_back();
    if (robot_.move(back, options_.approach_speed_m_s) == Motion::refused) break;
    back_m += (back.translation() - here_.translation()).norm();
    here_ = back;
    if (!is_felt(robot_.read())) break;
  }
  std::ostringstream words;
  words.precision(3);
  words << "hit something on the way to the push: " << change_n.norm() << " N at (" << at_m.x() << " " << at_m.y() << " " << at_m.z()
        << ") m; the arm went back " << 1000 * back_m << " mm. Look what stands there before it goes on";
  throw Stopped{StopReason::obstacle, words.str()};
}

bool GuardedMotion::go(const Pose& to, const Leaving& leaving) {
  trail_.clear();
  listen();
  constexpr double turn_rad = 0.1;
  from_m_ = here_.translation();
  motion_ = (to.translation() - from_m_).normalized();
  for (const Pose& next : in_pieces(here_, to, options_.look_every_m, turn_rad)) {
    ask_user_();
    if (robot_.move(next, options_.approach_speed_m_s) == Motion::refused) return false;
    trail_.push_back(std::exchange(here_, next));
    watch(leaving, (here_.translation() - from_m_).norm());
  }
  return true;
}

}  // namespace palpate::acquisition
