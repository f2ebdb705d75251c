// SPDX-License-Identifier: Apache-2.0
// How a push goes on and how it ends.
#include "palpate/acquisition/push_run.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "palpate/acquisition/ways_around.hpp"

namespace palpate::acquisition {

PushRun::PushRun(Robot& robot, const PushPlan& plan, const PushOptions& options, const OnStep& on_step,
                 const std::function<bool()>& keep_going, const Push* so_far)
    : robot_(robot, options.sample_period_s),
      plan_(plan),
      asked_(options),
      options_(within(robot.limits(), options)),
      on_step_(on_step),
      keep_going_(keep_going) {
  push_.name = plan.name;
  push_.site = plan.site;
  if (!so_far) return;
  recorded_ = recorded_part(*so_far, plan.direction);
  next_index_ = recorded_.steps;
  before_ = recorded_.before;
  report_.highest_force_n = recorded_.force_n;
  report_.deepest_m = recorded_.travel_m;
}

PushReport PushRun::run() {
  if (recorded_.again) {
    told({StopReason::force_limit, "nothing of it was missing"});
    return report_;
  }
  try {
    push();
  } catch (...) {
    let_go();
    throw;
  }
  say_what_was_too_much();
  return report_;
}

void PushRun::push() {
  try {
    look_at_rest();
    const Stopped stop = is_pressed_already() ? Stopped{StopReason::force_limit, "only the look after it was missing"} : press();
    told(stop);
    if (is_at_a_limit(stop.reason)) go_back_step_by_step();
  } catch (const Stopped& stop) {
    told(stop);
  }
  // From beside the push's line nobody knows what lies between.
  if (report_.stop != StopReason::user && in_front_) retreat();
  if (report_.stop == StopReason::user || !in_front_) robot_.stop();  // where it is: only the user knows why
}

void PushRun::let_go() noexcept {
  const auto quietly = [](auto&& act) {
    try {
      return act();
    } catch (...) {
      return false;
    }
  };
  quietly([&] { return robot_.stop(), true; });
  if (!in_front_) return;  // the tip has not been on the push's line yet: nobody knows what lies between
  // All the way, or as much of it as the robot does; a user who wants it to stand is still obeyed.
  for (const Pose& back : in_pieces(pose_at(at_m_), pose_at(-options_.start_distance_m), options_.look_every_m, 1)) {
    if (quietly([&] { return keep_going_ && !keep_going_(); })) return;
    if (!quietly([&] { return robot_.move(back, options_.approach_speed_m_s) == Motion::done; })) return;
  }
}

void PushRun::move_to(double distance_m, double speed_m_s) {
  ask_user();
  if (robot_.move(pose_at(distance_m), speed_m_s) == Motion::refused)
    throw Stopped{StopReason::robot_limit, "the robot refused to move on: a limit, or out of reach"};
  at_m_ = distance_m;
  in_front_ = true;
}

void PushRun::go_back_step_by_step() {
  for (int k = first_way_back(); k <= options_.unloading_steps; ++k) {
    const double target = way_back_n(k);
    for (;;) {
      const RobotState state = look();
      if (!(pressing(state) > target) || !(travel(look()) > 0)) break;
      step_back(state);
    }
    const RobotState there = look();  // once more, for the same reason as on the way in
    if (pressing(there) - 2 * lengths_.stiffness_n_m(seen(there)) * back_m(there) > lost_n()) step_back(there);
    if (pressing(look()) < lost_n()) break;  // the object stayed behind: nothing left to record under load
    settle_and_record(true);
  }
}

void PushRun::go_back_to_start() {
  {
    const OnTheWay on_the_way(robot_);
    GuardedMotion motion(robot_, options_, [this] { ask_user(); });
    const auto stands_here = [&] { at_m_ = along(motion.here().translation() - plan_.contact_m); };
    try {
      go_or_stop(motion, pose_at(-options_.start_distance_m), {pressed_m(motion.here()) + options_.search_distance_m, true});
    } catch (...) {
      stands_here();
      throw;
    }
    stands_here();
  }
  move_to(-options_.start_distance_m, options_.approach_speed_m_s);
}

void PushRun::retreat() {
  try {
    go_back_to_start();
    const FreeAir air = listen();
    report_.drift_n = (air.mean_n - report_.tare_n).norm();
    if (loaded_) report_.drift = ForceDrift{(air.mean_n - report_.tare_n) / (air.time_s - tared_at_s_), tared_at_s_};
    if (report_.stop != StopReason::no_contact) record(air.last, {}, 0, true);
  } catch (const Stopped& stop) {
    robot_.stop();
    if (stop.reason == StopReason::user || stop.reason == StopReason::obstacle) return told(stop);
    report_.message += "; then " + stop.message;
  }
}

}  // namespace palpate::acquisition
