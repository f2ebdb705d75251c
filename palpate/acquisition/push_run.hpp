// SPDX-License-Identifier: Apache-2.0
// One push as it is being made. Inner header of the room.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "palpate/acquisition/fresh_readings.hpp"
#include "palpate/acquisition/guarded_motion.hpp"
#include "palpate/acquisition/motion_lengths.hpp"
#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/acquisition/recorded_part.hpp"
#include "palpate/acquisition/stopped.hpp"
#include "palpate/acquisition/torque_mean.hpp"

namespace palpate::acquisition {

class PushRun {
 public:
  PushRun(Robot& robot, const PushPlan& plan, const PushOptions& options, const OnStep& on_step,
          const std::function<bool()>& keep_going, const Push* so_far);

  PushReport run();

 private:
  void push();

  void say_what_was_too_much() {
    const double over_n = std::max(report_.highest_force_n, peak_n_) - options_.force_limit_n;
    if (over_n <= 5 * free_air_std_n_) return;
    report_.overshoot_n = over_n;
    report_.highest_force_n = options_.force_limit_n + over_n;
  }

  void told(const Stopped& stop) {
    report_.stop = stop.reason;
    report_.message = stop.message;
  }

  // Something broke: the robot, or whoever records. The object must not stay pressed, and what the way back itself throws says
  // less than what broke first.
  void let_go() noexcept;

  double along(const Vec3& v) const { return plan_.direction.dot(v); }
  Vec3 force(const RobotState& state) const { return state.force_n - report_.tare_n; }
  double pressing(const RobotState& state) const { return along(force(state)); }
  double travel(const RobotState& state) const { return along(state.T_base_tip.translation() - report_.contact_m); }
  // Until a step has told where the force began, contact counts from where it was noticed. Limits hold from where it began, as far
  // as that can be known.
  double late_m(double travel_m);
  double gone_m(const RobotState& state) { return travel(state) + late_m(travel(state)); }
  bool is_at_travel_limit(const RobotState& state) {
    const double fine_m = begins_late_ ? 0.1 * options_.increment_m : 1e-9;  // as fine as late_m() is
    return gone_m(state) >= options_.travel_limit_m - fine_m;
  }
  RobotState look() {
    const RobotState state = robot_.read();
    peak_n_ = std::max(peak_n_, pressing(state));
    return state;
  }
  sensing::ContactSample sample(const RobotState& state) {
    peak_n_ = std::max(peak_n_, pressing(state));
    return {state.time_s, force(state), state.T_base_tip.translation()};
  }

  void ask_user() const {
    if (keep_going_ && !keep_going_()) throw Stopped{StopReason::user, "stopped on request"};
  }

  Pose pose_at(double distance_m) const {
    Pose pose = Pose::Identity();
    pose.linear() = plan_.R_base_tip;
    pose.translation() = plan_.contact_m + distance_m * plan_.direction;
    return pose;
  }

  void move_to(double distance_m, double speed_m_s);

  // From wherever the tip stands, clear of the object; the last motion is move_to().
  void come_to_start();
  bool stands_on_the_line(const Pose& tip) const;
  double pressed_m(const Pose& tip) const;
  void go_around(GuardedMotion& motion, const KeepOut& around);
  void go_blindly(GuardedMotion& motion);
  void go_or_stop(GuardedMotion& motion, const Pose& to, const Leaving& leaving = {});
  // False where the robot refuses every way; where each ended is added.
  bool go_one_of(GuardedMotion& motion, const KeepOut& box, const Pose& to, std::vector<Pose>& refused);
  // Back to where the push began.
  void go_back_to_start();

  struct FreeAir {
    Vec3 mean_n = Vec3::Zero();
    double time_s = 0;  // its middle
    double std_n = 0;   // of one sample, along the push
    double std_of_worst_axis_n = 0;
    std::optional<TorqueMean> torque;
    RobotState last;
  };
  FreeAir listen();

  // Free air: the tare, its noise, and the object untouched.
  void look_at_rest();

  // Of an earlier run: the last step of the rise stands on the record, and a way back still has to start from it.
  bool top_is_recorded() const {
    if (recorded_.unloading) return true;
    return recorded_.force_n > 0 && (recorded_.force_n >= options_.force_limit_n - 0.5 * options_.force_step_n ||
                                     recorded_.travel_m >= options_.travel_limit_m - options_.increment_m);
  }
  bool is_pressed_already() const { return top_is_recorded() && first_way_back() > options_.unloading_steps; }

  void approach();
  // Nothing presses along the push, and a force is felt all the same.
  void watch_aside(std::span<const sensing::ContactSample> samples);
  // How far the tip stands behind where it was sent; the same all the time but where it yields, or does not follow.
  double behind_m(const Vec3& tip_m) const { return at_m_ - along(tip_m - plan_.contact_m); }
  double much_behind_m() const { return std::max(4 * options_.increment_m, 10 * robot_.travel_sigma_m()); }
  [[noreturn]] void stays_behind(double by_m) const;
  // What is left of the travel limit, by the encoders and by where the tip was sent: one that yields or is held jumps there when it
  // comes free.
  double travel_left_m(const RobotState& state);

  void touched(const std::vector<sensing::ContactSample>& samples, std::size_t contact, double motion_m);

  // A first touch of little more than noise may be lost to the arm's own repeat error: the approach then goes on.
  Stopped press();

  // The least force that still counts as contact: half of what found it.
  double lost_n() const {
    return 0.5 * std::max(options_.contact.threshold_n, options_.contact.noise_factor * free_air_std_n_);
  }
  double step_n() const { return std::min(options_.force_step_n, options_.force_limit_n); }

  Stopped rise();

  // Whose limit it was that ended the push.
  Stopped at_force_limit() const;
  Stopped at_travel_limit() const;

  // What an earlier run has on record is not recorded again, but the way back starts from it as it did: settled.
  void end_rise(bool top_recorded) {
    if (top_recorded)
      settle(false);
    else
      settle_and_record(false);
  }

  void advance(const RobotState& state);

  MotionLengths::Seen seen(const RobotState& state) const { return {pressing(state), travel(state)}; }
  double next_m(const RobotState& state) const { return lengths_.next_m(seen(state), at_m_); }

  // Even if the object is twice as stiff there as it was up to here.
  bool has_room_for_one_more(const RobotState& state) const {
    return pressing(state) + 2 * lengths_.stiffness_n_m(seen(state)) * next_m(state) < options_.force_limit_n;
  }

  void watch_out();

  struct Settled {
    RobotState last;
    Vec3 mean_n = Vec3::Zero();
    double sigma_n = 0;
    std::optional<TorqueMean> torque;  // as it was read
    bool settled = false;
  };
  Settled settle(bool unloading);

  void settle_and_record(bool unloading);

  // It says where the force acts beside the tip, which is known as well as the joints are read: nothing new of a contact that is
  // exactly known.
  std::optional<Wrench> torque_of(const Settled& step) const;

  // The push states one error of its force's zero, but its parts before and after a cut have two tares, whose errors are
  // independent. Steps that go on carry the difference, so much each that the mean over all that may follow carries it once.
  double second_tare_std_n() const {
    if (recorded_.force_n == 0) return 0;
    const double levels = std::ceil(std::max(0.0, options_.force_limit_n - recorded_.force_n) / options_.force_step_n);
    return std::sqrt(2 * std::max(1.0, levels + options_.unloading_steps)) * push_.force_tare_std_n;
  }

  // Contact is noticed late, by what the threshold needs: travel counts from where the force really began.
  void begin_where_the_force_began();

  void record(const RobotState& state, const std::optional<Vec3>& force_n, double sigma_n, bool unloading,
              const std::optional<Wrench>& torque = {});

  // A camera that moves with the arm stands elsewhere by now: only images from one place can be compared.
  void look_whether_it_came_back(const DepthFrame& after);

  // Equally spaced in force below the highest.
  double way_back_n(int k) const {
    return std::max(top_n_, recorded_.force_n) * (1 - double(k) / (options_.unloading_steps + 1));
  }
  // Steps of the way back that an earlier run recorded lie below their force by less than half of what is between two.
  int first_way_back() const {
    int k = 1;
    while (k <= options_.unloading_steps && way_back_n(k) > recorded_.back_at_n - 0.5 * way_back_n(options_.unloading_steps)) ++k;
    return k;
  }

  // After a cut it starts from the top once more. A material that remembers its loads is sent to the greatest of them again: it
  // then goes on as if the way back in between had not been (return-point memory, Madelung 1905).
  void go_back_step_by_step();

  double back_m(const RobotState& state) const { return lengths_.back_m(seen(state), way_back_n(options_.unloading_steps)); }
  void step_back(const RobotState& state) {
    move_to(at_m_ - back_m(state), options_.push_speed_m_s);
    robot_.wait(options_.sample_period_s);
  }

  // Away from the object whatever happened, and did it come back?
  void retreat();

  FreshReadings robot_;
  const PushPlan& plan_;
  const PushOptions asked_;    // what the user wants
  const PushOptions options_;  // and of that, what the robot bears
  const OnStep& on_step_;
  const std::function<bool()>& keep_going_;
  Push push_;
  PushReport report_;
  RecordedPart recorded_;
  MotionLengths lengths_{options_};
  std::vector<sensing::ContactSample> approach_, history_;  // before contact was noticed, and since
  Vec3 noticed_m_ = Vec3::Zero();                           // there
  std::size_t late_of_ = 0;                                 // so many samples of history_ gave ...
  double late_m_ = 0;                                       // ... this
  double free_air_std_n_ = 0, worst_axis_std_n_ = 0, tared_at_s_ = 0;
  Mat3 R_base_tip_tared_ = Mat3::Identity();
  std::optional<TorqueMean> torque_tare_;
  bool in_front_ = false;     // the tip has been in front of the object
  bool loaded_ = false;       // a step under load is recorded
  bool begins_late_ = false;  // contact was noticed, and is not corrected yet for the force that this took
  double at_m_ = 0;           // commanded, along the push from the expected contact
  double touched_at_m_ = 0;   // the same, when contact was noticed
  double top_n_ = 0, peak_n_ = 0;  // the highest force of the rise, and of all
  std::optional<double> recorded_at_m_;  // of the last loaded step
  int next_index_ = 0;
  std::optional<DepthFrame> before_;  // the untouched object
};

}  // namespace palpate::acquisition
