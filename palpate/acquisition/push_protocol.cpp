// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/push_protocol.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "palpate/acquisition/force_begin.hpp"
#include "palpate/acquisition/motion_lengths.hpp"
#include "palpate/acquisition/recorded_part.hpp"
#include "palpate/acquisition/torque_mean.hpp"
#include "palpate/core/error.hpp"
#include "palpate/sensing/rest_change.hpp"

namespace palpate::acquisition {
namespace {

struct Stopped {
  StopReason reason;
  std::string message;
};

class PushRun {
 public:
  PushRun(Robot& robot, const PushPlan& plan, const PushOptions& options, const OnStep& on_step,
          const std::function<bool()>& keep_going, const Push* so_far)
      : robot_(robot), plan_(plan), options_(options), on_step_(on_step), keep_going_(keep_going) {
    push_.name = plan.name;
    push_.site = plan.site;
    if (!so_far) return;
    recorded_ = recorded_part(*so_far, plan.direction);
    next_index_ = recorded_.steps;
    before_ = recorded_.before;
    report_.highest_force_n = recorded_.force_n;
    report_.deepest_m = recorded_.travel_m;
  }

  PushReport run() {
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

 private:
  void push() {
    try {
      look_at_rest();
      const Stopped stop = is_pressed_already() ? Stopped{StopReason::force_limit, "only the look after it was missing"} : press();
      told(stop);
      if (stop.reason == StopReason::force_limit || stop.reason == StopReason::travel_limit) go_back_step_by_step();
    } catch (const Stopped& stop) {
      told(stop);
    }
    if (report_.stop != StopReason::user) retreat();
    if (report_.stop == StopReason::user) robot_.stop();  // where it is: only the user knows why
  }

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
  void let_go() noexcept {
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
    for (const double share : {1.0, 0.5, 0.25, 0.125}) {
      if (quietly([&] { return keep_going_ && !keep_going_(); })) return;
      const double back_m = share * (at_m_ + options_.start_distance_m);
      if (quietly([&] { return robot_.move(pose_at(at_m_ - back_m), options_.approach_speed_m_s) == Motion::done; })) return;
    }
  }

  double along(const Vec3& v) const { return plan_.direction.dot(v); }
  Vec3 force(const RobotState& state) const { return state.force_n - report_.tare_n; }
  double pressing(const RobotState& state) const { return along(force(state)); }
  double travel(const RobotState& state) const { return along(state.T_base_tip.translation() - report_.contact_m); }
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

  void move_to(double distance_m, double speed_m_s) {
    ask_user();
    if (robot_.move(pose_at(distance_m), speed_m_s) == Motion::refused)
      throw Stopped{StopReason::robot_limit, "the robot refused to move on: a limit, or out of reach"};
    at_m_ = distance_m;
    in_front_ = true;
  }

  struct FreeAir {
    Vec3 mean_n = Vec3::Zero();
    double time_s = 0;  // its middle
    double std_n = 0;   // of one sample, along the push
    std::optional<TorqueMean> torque;
    RobotState last;
  };
  FreeAir listen() {
    FreeAir air;
    std::vector<Vec3> forces;
    std::vector<std::optional<Vec3>> torques;
    for (int i = 0; i < options_.free_air_samples; ++i) {
      ask_user();
      robot_.wait(options_.sample_period_s);
      air.last = robot_.read();
      forces.push_back(air.last.force_n);
      torques.push_back(air.last.torque_nm);
      air.mean_n += air.last.force_n / options_.free_air_samples;
      air.time_s += air.last.time_s / options_.free_air_samples;
    }
    double square = 0;
    for (const Vec3& f : forces) square += std::pow(along(f - air.mean_n), 2);
    air.std_n = std::sqrt(square / std::max(1, options_.free_air_samples - 1));
    air.torque = torque_mean(torques);
    return air;
  }

  // Free air: the tare, its noise, and the object untouched.
  void look_at_rest() {
    move_to(-options_.start_distance_m, options_.approach_speed_m_s);
    const FreeAir air = listen();
    report_.tare_n = air.mean_n;
    tared_at_s_ = air.time_s;
    free_air_std_n_ = air.std_n;
    torque_tare_ = air.torque;
    if (torque_tare_ && options_.contact_std_m > 0) {
      push_.torque_tare_std_nm = torque_tare_->mean_std_nm();
      push_.tip_std_m = options_.contact_std_m;  // where the arm believes its tip to be is what makes the contact uncertain
    }
    const double travel_sigma_m = robot_.travel_sigma_m();
    lengths_.state_noise(free_air_std_n_, travel_sigma_m);
    // A push that goes on is one push with one statement.
    push_.force_tare_std_n = std::max(free_air_std_n_ / std::sqrt(double(options_.free_air_samples)), recorded_.force_tare_std_n);
    push_.travel_offset_std_m = std::max(travel_offset_std_m(options_, travel_sigma_m), recorded_.travel_offset_std_m);
    if (!recorded_.rest) record(air.last, {}, 0, false);
  }

  // Of an earlier run: the last step of the rise stands on the record, and a way back still has to start from it.
  bool top_is_recorded() const {
    if (recorded_.unloading) return true;
    return recorded_.force_n > 0 && (recorded_.force_n >= options_.force_limit_n - 0.5 * options_.force_step_n ||
                                     recorded_.travel_m >= options_.travel_limit_m - options_.increment_m);
  }
  bool is_pressed_already() const { return top_is_recorded() && first_way_back() > options_.unloading_steps; }

  void approach() {
    std::vector<sensing::ContactSample> samples;
    double motion_m = options_.increment_m, fine_until_m = -options_.start_distance_m;
    while (at_m_ < options_.search_distance_m) {
      if (at_m_ > fine_until_m) motion_m = options_.increment_m;
      move_to(at_m_ + motion_m, options_.approach_speed_m_s);
      for (int i = 0; i < options_.contact.confirm_samples; ++i) {
        robot_.wait(options_.sample_period_s);
        samples.push_back(sample(robot_.read()));
      }
      const auto contact = sensing::find_contact(samples, plan_.direction, free_air_std_n_, options_.contact);
      if (!contact) continue;
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

  void touched(const std::vector<sensing::ContactSample>& samples, std::size_t contact, double motion_m) {
    noticed_m_ = samples[contact].tip_m;
    // Encoders are absolute: what goes on counts from the zero that the recorded travels have.
    report_.contact_m = recorded_.contact_m.value_or(noticed_m_);
    begins_late_ = true;
    approach_.assign(samples.begin(), samples.begin() + std::ptrdiff_t(contact));
    history_.assign(samples.begin() + std::ptrdiff_t(contact), samples.end());
    lengths_.touched(at_m_, motion_m);
  }

  // A first touch of little more than noise may be lost to the arm's own repeat error: the approach then goes on.
  Stopped press() {
    constexpr int touches = 5;
    for (int touch = 1;; ++touch) {
      approach();
      try {
        return rise();
      } catch (const Stopped& stop) {
        const bool hardly_touched = !loaded_ && recorded_.force_n == 0 && top_n_ < options_.force_step_n;
        if (stop.reason != StopReason::contact_lost || !hardly_touched || touch == touches) throw;
      }
    }
  }

  // The least force that still counts as contact: half of what found it.
  double lost_n() const {
    return 0.5 * std::max(options_.contact.threshold_n, options_.contact.noise_factor * free_air_std_n_);
  }
  double step_n() const { return std::min(options_.force_step_n, options_.force_limit_n); }

  Stopped rise() {
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
        return {StopReason::force_limit, "the force reached its limit"};
      }
      if (travel(state) >= options_.travel_limit_m - 1e-9) {
        end_rise(top_recorded);
        return {StopReason::travel_limit, "the travel reached its limit"};
      }
      if (now >= std::min(target, options_.force_limit_n)) {
        // The motion that got there was picked for its own error, too: the tip stands deeper than the encoders say more often
        // than not. Of one more motion nothing is known yet.
        if (has_room_for_one_more(state)) {
          advance(state);
          if (lengths_.is_far_beyond(along(history_.back().force_n), at_m_)) continue;
        }
        target += options_.force_step_n;
        if (travel(robot_.read()) < options_.travel_limit_m - 1e-9) settle_and_record(false);  // else as the last one
        continue;
      }
      advance(state);
    }
  }

  // What an earlier run has on record is not recorded again, but the way back starts from it as it did: settled.
  void end_rise(bool top_recorded) {
    if (top_recorded)
      settle(false);
    else
      settle_and_record(false);
  }

  void advance(const RobotState& state) {
    const double from_m = at_m_;
    move_to(at_m_ + std::min(next_m(state), options_.travel_limit_m - travel(state)), options_.push_speed_m_s);
    robot_.wait(options_.sample_period_s);
    history_.push_back(sample(robot_.read()));
    lengths_.moved(at_m_ - from_m, along(history_.back().force_n) - pressing(state));
    watch_out();
  }

  MotionLengths::Seen seen(const RobotState& state) const { return {pressing(state), travel(state)}; }
  double next_m(const RobotState& state) const { return lengths_.next_m(seen(state), at_m_); }

  // Even if the object is twice as stiff there as it was up to here.
  bool has_room_for_one_more(const RobotState& state) const {
    return pressing(state) + 2 * lengths_.stiffness_n_m(seen(state)) * next_m(state) < options_.force_limit_n;
  }

  void watch_out() const {
    // Below the first step, the arm's own repeat error moves the force of a soft object by more than slip would.
    sensing::SlipOptions slip = options_.slip;
    slip.least_force_n = std::max(slip.least_force_n, step_n());
    const sensing::PushEvent event = sensing::watch(history_, plan_.direction, lost_n(), slip);
    if (event == sensing::PushEvent::none) return;
    throw Stopped{event == sensing::PushEvent::contact_lost ? StopReason::contact_lost : StopReason::slip,
                  sensing::to_words(event)};
  }

  struct Settled {
    RobotState last;
    Vec3 mean_n = Vec3::Zero();
    double sigma_n = 0;
    std::optional<TorqueMean> torque;  // as it was read
    bool settled = false;
  };
  Settled settle(bool unloading) {
    std::vector<sensing::ContactSample> samples;
    const double start = robot_.read().time_s;
    sensing::Settling state;
    Settled out;
    std::vector<std::optional<Vec3>> torques;
    do {
      ask_user();
      robot_.wait(options_.sample_period_s);
      out.last = robot_.read();
      samples.push_back(sample(out.last));
      torques.push_back(out.last.torque_nm);
      state = sensing::settling(samples, plan_.direction, options_.settling);
    } while (!state.settled && out.last.time_s - start < options_.settling_timeout_s);
    out.settled = state.settled;
    // The recorded force is the mean over the last window, as `settling` sees it.
    Vec3 square = Vec3::Zero();
    double count = 0;
    for (auto s = samples.rbegin(); s != samples.rend() && s->time_s >= out.last.time_s - options_.settling.window_s; ++s) {
      out.mean_n += s->force_n;
      square += s->force_n.cwiseAbs2();
      ++count;
    }
    out.mean_n /= count;
    out.torque = torque_mean({torques.end() - std::ptrdiff_t(count), torques.end()});
    const Vec3 variance = (square / count - out.mean_n.cwiseAbs2()).cwiseMax(0.0);
    out.sigma_n = std::sqrt(std::max(variance.mean(), free_air_std_n_ * free_air_std_n_ * 0.01) / count);
    history_.insert(history_.end(), samples.begin(), samples.end());
    if (!unloading) watch_out();
    begin_where_the_force_began();
    report_.deepest_m = std::max(report_.deepest_m, travel(out.last));  // as it is recorded: a touch of one step tells a stiffness
    return out;
  }

  void settle_and_record(bool unloading) {
    if (recorded_at_m_ == at_m_) return;  // nothing moved since: it would be the same step once more
    recorded_at_m_ = at_m_;
    const Settled step = settle(unloading);
    if (!step.settled) report_.unsettled.push_back(next_index_);
    loaded_ = true;
    record(step.last, step.mean_n, std::hypot(step.sigma_n, second_tare_std_n()), unloading, torque_of(step));
  }

  // It says where the force acts beside the tip, which is known as well as the joints are read: nothing new of a contact that is
  // exactly known.
  std::optional<Wrench> torque_of(const Settled& step) const {
    if (!step.torque || !torque_tare_ || !(options_.contact_std_m > 0)) return std::nullopt;
    Wrench wrench;
    wrench.time_s = step.last.time_s;
    wrench.force_n = step.mean_n;
    wrench.force_sigma_n = step.sigma_n;
    wrench.has_torque = true;
    wrench.torque_nm = step.torque->mean_nm - torque_tare_->mean_nm;
    const double noise_nm = std::max(step.torque->mean_std_nm(), 0.1 * torque_tare_->mean_std_nm());
    wrench.torque_sigma_nm = std::hypot(noise_nm, robot_.travel_sigma_m() * step.mean_n.norm());
    wrench.tool = plan_.tool;
    return wrench.torque_sigma_nm > 0 ? std::optional(wrench) : std::nullopt;
  }

  // The push states one error of its force's zero, but its parts before and after a cut have two tares, whose errors are
  // independent. Steps that go on carry the difference, so much each that the mean over all that may follow carries it once.
  double second_tare_std_n() const {
    if (recorded_.force_n == 0) return 0;
    const double levels = std::ceil(std::max(0.0, options_.force_limit_n - recorded_.force_n) / options_.force_step_n);
    return std::sqrt(2 * std::max(1.0, levels + options_.unloading_steps)) * push_.force_tare_std_n;
  }

  // Contact is noticed late, by what the threshold needs: travel counts from where the force really began.
  void begin_where_the_force_began() {
    if (!begins_late_) return;
    begins_late_ = false;
    approach_.insert(approach_.end(), history_.begin(), history_.end());
    const ForceBeginSearch search{options_.search_distance_m, options_.increment_m, lengths_.finest_m()};
    const Vec3 began_m = noticed_m_ - force_began_before_m(approach_, noticed_m_, plan_.direction, search) * plan_.direction;
    approach_.clear();
    if (!recorded_.contact_m) {
      report_.contact_m = began_m;
      return;
    }
    // Each of the two is known as well as the push states; what is beyond that has moved since.
    const double moved_m = along(began_m - *recorded_.contact_m);
    if (std::abs(moved_m) > 4 * std::numbers::sqrt2 * push_.travel_offset_std_m)
      throw Stopped{StopReason::moved, "contact begins " + std::to_string(1000 * std::abs(moved_m)) + " mm " +
                                           (moved_m > 0 ? "deeper" : "earlier") +
                                           " than in the part that is recorded: object or arm moved in between; push there anew"};
  }

  void record(const RobotState& state, const std::optional<Vec3>& force_n, double sigma_n, bool unloading,
              const std::optional<Wrench>& torque = {}) {
    Step step;
    step.time_s = state.time_s;
    step.joints_rad = state.joints_rad;
    step.T_base_tip = state.T_base_tip;
    step.unloading = unloading;
    if (force_n) {
      Load load;
      load.tool = plan_.tool;
      load.force_n = *force_n;
      load.force_std_n = sigma_n;
      load.contact_m = report_.contact_m;
      load.direction = plan_.direction;
      load.contact_std_m = options_.contact_std_m;
      step.loads.push_back(load);
      ToolTravel encoder;
      encoder.tool = plan_.tool;
      encoder.travel_m = travel(state);
      encoder.sigma_m = robot_.travel_sigma_m();
      step.observations.emplace_back(encoder);
      if (torque) step.observations.emplace_back(*torque);
    }
    DepthFrame image = robot_.take_depth_image();
    if (!force_n && !unloading) before_ = image;
    if (!force_n && unloading && before_) look_whether_it_came_back(image);
    step.observations.emplace_back(std::move(image));
    if (on_step_) on_step_(push_, step);
    ++next_index_;
    ++report_.steps;
  }

  // A camera that moves with the arm stands elsewhere by now: only images from one place can be compared.
  void look_whether_it_came_back(const DepthFrame& after) {
    const DepthFrame& before = *before_;
    if (before.depth_m.rows() != after.depth_m.rows() || before.depth_m.cols() != after.depth_m.cols()) return;
    if (!before.T_base_camera.isApprox(after.T_base_camera, 1e-6)) return;
    report_.compared = true;
    report_.changed_share = sensing::changed_share(before, after);
    report_.came_back = report_.changed_share <= options_.changed_share;
  }

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
  void go_back_step_by_step() {
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

  double back_m(const RobotState& state) const { return lengths_.back_m(seen(state), way_back_n(options_.unloading_steps)); }
  void step_back(const RobotState& state) {
    move_to(at_m_ - back_m(state), options_.push_speed_m_s);
    robot_.wait(options_.sample_period_s);
  }

  // Away from the object whatever happened, and did it come back?
  void retreat() {
    try {
      move_to(-options_.start_distance_m, options_.approach_speed_m_s);
      const FreeAir air = listen();
      report_.drift_n = (air.mean_n - report_.tare_n).norm();
      if (loaded_) report_.drift = ForceDrift{(air.mean_n - report_.tare_n) / (air.time_s - tared_at_s_), tared_at_s_};
      if (report_.stop != StopReason::no_contact) record(air.last, {}, 0, true);
    } catch (const Stopped& stop) {
      robot_.stop();
      if (stop.reason == StopReason::user) return told(stop);
      report_.message += "; then " + stop.message;
    }
  }

  Robot& robot_;
  const PushPlan& plan_;
  const PushOptions& options_;
  const OnStep& on_step_;
  const std::function<bool()>& keep_going_;
  Push push_;
  PushReport report_;
  RecordedPart recorded_;
  MotionLengths lengths_{options_};
  std::vector<sensing::ContactSample> approach_, history_;  // before contact was noticed, and since
  Vec3 noticed_m_ = Vec3::Zero();                           // there
  double free_air_std_n_ = 0, tared_at_s_ = 0;
  std::optional<TorqueMean> torque_tare_;
  bool in_front_ = false;     // the tip has been in front of the object
  bool loaded_ = false;       // a step under load is recorded
  bool begins_late_ = false;  // contact was noticed, and is not corrected yet for the force that this took
  double at_m_ = 0;           // commanded, along the push from the expected contact
  double top_n_ = 0, peak_n_ = 0;  // the highest force of the rise, and of all
  std::optional<double> recorded_at_m_;  // of the last loaded step
  int next_index_ = 0;
  std::optional<DepthFrame> before_;  // the untouched object
};

}  // namespace

Mat3 tip_along(const Vec3& direction) {
  Mat3 rotation;
  const Vec3 x = (Vec3::UnitX() - direction.x() * direction).norm() > 0.1 ? Vec3::UnitX() : Vec3::UnitY();
  rotation.col(2) = direction;
  rotation.col(0) = (x - x.dot(direction) * direction).normalized();
  rotation.col(1) = direction.cross(rotation.col(0));
  return rotation;
}

PushReport run_push(Robot& robot, const PushPlan& plan, const PushOptions& options, const OnStep& on_step,
                    const std::function<bool()>& keep_going, const Push* so_far) {
  check(options);
  if (std::abs(plan.direction.norm() - 1) > 1e-6) throw Error("must have unit length", "PushPlan.direction");
  if (plan.tool.empty()) throw Error("must name a tool of the recording", "PushPlan.tool");
  return PushRun(robot, plan, options, on_step, keep_going, so_far).run();
}

Push whole_push(Robot& robot, const PushPlan& plan, const PushOptions& options) {
  Push made;
  std::vector<Step> steps;
  const PushReport report = run_push(robot, plan, options, [&](const Push& push, const Step& step) {
    made = push;
    steps.push_back(step);
  });
  made.steps = std::move(steps);
  if (report.drift) take_off(*report.drift, made);
  return made;
}

}  // namespace palpate::acquisition
