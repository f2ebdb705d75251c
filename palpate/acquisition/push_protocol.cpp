// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/push_protocol.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

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
    if (so_far)
      for (const Step& step : so_far->steps) {
        ++next_index_;
        const double force = step.loads.empty() || !step.loads[0].force_n ? 0 : step.loads[0].force_n->dot(plan.direction);
        recorded_unloading_ = recorded_unloading_ || step.unloading;
        recorded_force_n_ = std::max(recorded_force_n_, force);
        for (const Observation& seen : step.observations)
          if (const auto* encoder = std::get_if<ToolTravel>(&seen))
            recorded_travel_m_ = std::max(recorded_travel_m_, encoder->travel_m);
        recorded_rest_ = recorded_rest_ || force == 0;
        recorded_again_ = recorded_again_ || (step.unloading && force == 0);
        if (force == 0 && !step.unloading)
          for (const Observation& seen : step.observations)
            if (const auto* frame = std::get_if<DepthFrame>(&seen)) before_ = *frame;
      }
  }

  PushReport run() {
    try {
      look_at_rest();
      const Stopped stop = press();
      report_.stop = stop.reason;
      report_.message = stop.message;
      if (stop.reason == StopReason::force_limit || stop.reason == StopReason::travel_limit) go_back_step_by_step();
    } catch (const Stopped& stop) {
      report_.stop = stop.reason;
      report_.message = stop.message;
    }
    if (report_.stop == StopReason::user)
      robot_.stop();  // where it is: only the user knows why
    else
      retreat();
    return report_;
  }

 private:
  double along(const Vec3& v) const { return plan_.direction.dot(v); }
  Vec3 force(const RobotState& state) const { return state.force_n - report_.tare_n; }
  double pressing(const RobotState& state) const { return along(force(state)); }
  double stiffness_n_m(const RobotState& state) const { return pressing(state) / std::max(travel(state), options_.increment_m); }
  double travel(const RobotState& state) const { return along(state.T_base_tip.translation() - report_.contact_m); }
  sensing::ContactSample sample(const RobotState& state) const {
    return {state.time_s, force(state), state.T_base_tip.translation()};
  }

  void ask_user() const {
    if (keep_going_ && !keep_going_()) throw Stopped{StopReason::user, "stopped on request"};
  }

  void move_to(double distance_m, double speed_m_s) {
    ask_user();
    Pose pose = Pose::Identity();
    pose.linear() = plan_.R_base_tip;
    pose.translation() = plan_.contact_m + distance_m * plan_.direction;
    if (robot_.move(pose, speed_m_s) == Motion::refused)
      throw Stopped{StopReason::robot_limit, "the robot refused to move on: a limit, or out of reach"};
    at_m_ = distance_m;
  }

  struct FreeAir {
    Vec3 mean_n = Vec3::Zero();
    double time_s = 0;  // its middle
    double std_n = 0;   // of one sample, along the push
    RobotState last;
  };
  FreeAir listen() {
    FreeAir air;
    std::vector<Vec3> forces;
    for (int i = 0; i < options_.free_air_samples; ++i) {
      robot_.wait(options_.sample_period_s);
      air.last = robot_.read();
      forces.push_back(air.last.force_n);
      air.mean_n += air.last.force_n / options_.free_air_samples;
      air.time_s += air.last.time_s / options_.free_air_samples;
    }
    double square = 0;
    for (const Vec3& f : forces) square += std::pow(along(f - air.mean_n), 2);
    air.std_n = std::sqrt(square / std::max(1, options_.free_air_samples - 1));
    return air;
  }

  // Free air: the tare, its noise, and the object untouched.
  void look_at_rest() {
    move_to(-options_.start_distance_m, options_.approach_speed_m_s);
    const FreeAir air = listen();
    report_.tare_n = air.mean_n;
    tared_at_s_ = air.time_s;
    free_air_std_n_ = air.std_n;
    push_.force_tare_std_n = free_air_std_n_ / std::sqrt(double(options_.free_air_samples));
    push_.travel_offset_std_m = travel_offset_std_m(options_, robot_.travel_sigma_m());
    if (!recorded_rest_) record(air.last, {}, 0, false);
  }

  void approach() {
    std::vector<sensing::ContactSample> samples;
    while (at_m_ < options_.search_distance_m) {
      move_to(at_m_ + options_.increment_m, options_.approach_speed_m_s);
      for (int i = 0; i < options_.contact.confirm_samples; ++i) {
        robot_.wait(options_.sample_period_s);
        samples.push_back(sample(robot_.read()));
      }
      const auto contact = sensing::find_contact(samples, plan_.direction, free_air_std_n_, options_.contact);
      if (!contact) continue;
      report_.contact_m = samples[*contact].tip_m;
      begins_late_ = true;
      approach_.assign(samples.begin(), samples.begin() + std::ptrdiff_t(*contact));
      history_.assign(samples.begin() + std::ptrdiff_t(*contact), samples.end());
      return;
    }
    throw Stopped{StopReason::no_contact, "no contact within " + std::to_string(1000 * options_.search_distance_m) +
                                              " mm beyond the expected surface"};
  }

  // A first touch of little more than noise may be lost to the arm's own repeat error: the approach then goes on.
  Stopped press() {
    constexpr int touches = 5;
    for (int touch = 1;; ++touch) {
      approach();
      try {
        return rise();
      } catch (const Stopped& stop) {
        const bool hardly_touched = !loaded_ && recorded_force_n_ == 0 && report_.highest_force_n < options_.force_step_n;
        if (stop.reason != StopReason::contact_lost || !hardly_touched || touch == touches) throw;
      }
    }
  }

  // The least force that still counts as contact: half of what found it.
  double lost_n() const {
    return 0.5 * std::max(options_.contact.threshold_n, options_.contact.noise_factor * free_air_std_n_);
  }

  Stopped rise() {
    double target = std::max(options_.force_step_n, recorded_force_n_ + options_.force_step_n);
    if (recorded_unloading_) return {StopReason::force_limit, "the rise was recorded before"};
    // The last step of the rise may stand on the record already; the way back still has to start from it.
    const bool top_recorded = recorded_force_n_ >= options_.force_limit_n - 0.5 * options_.force_step_n ||
                              recorded_travel_m_ >= options_.travel_limit_m - options_.increment_m;
    for (;;) {
      const RobotState state = robot_.read();
      const double now = pressing(state);
      report_.highest_force_n = std::max(report_.highest_force_n, now);
      report_.deepest_m = std::max(report_.deepest_m, travel(state));
      if (now >= options_.force_limit_n) {
        if (!top_recorded) settle_and_record(false);
        return {StopReason::force_limit, "the force reached its limit"};
      }
      if (travel(state) >= options_.travel_limit_m - 1e-9) {
        if (!top_recorded) settle_and_record(false);
        return {StopReason::travel_limit, "the travel reached its limit"};
      }
      if (now >= std::min(target, options_.force_limit_n)) {
        // The motion that got there was picked for its own error, too: the tip stands deeper than the encoders say more often
        // than not. Of one more motion nothing is known yet.
        if (has_room_for_one_more(state)) advance(state);
        target += options_.force_step_n;
        if (travel(robot_.read()) < options_.travel_limit_m - 1e-9) settle_and_record(false);  // else as the last one
        continue;
      }
      advance(state);
    }
  }

  void advance(const RobotState& state) {
    move_to(at_m_ + std::min(options_.increment_m, options_.travel_limit_m - travel(state)), options_.push_speed_m_s);
    robot_.wait(options_.sample_period_s);
    history_.push_back(sample(robot_.read()));
    watch_out();
  }

  // Even if the object is twice as stiff there as it was up to here.
  bool has_room_for_one_more(const RobotState& state) const {
    return pressing(state) + 2 * stiffness_n_m(state) * options_.increment_m < options_.force_limit_n;
  }

  void watch_out() const {
    // Below the first step, the arm's own repeat error moves the force of a soft object by more than slip would.
    sensing::SlipOptions slip = options_.slip;
    slip.least_force_n = std::max(slip.least_force_n, options_.force_step_n);
    const sensing::PushEvent event = sensing::watch(history_, plan_.direction, lost_n(), slip);
    if (event == sensing::PushEvent::none) return;
    throw Stopped{event == sensing::PushEvent::contact_lost ? StopReason::contact_lost : StopReason::slip,
                  sensing::to_words(event)};
  }

  void settle_and_record(bool unloading) {
    if (recorded_at_m_ == at_m_) return;  // nothing moved since: it would be the same step once more
    recorded_at_m_ = at_m_;
    std::vector<sensing::ContactSample> samples;
    const double start = robot_.read().time_s;
    sensing::Settling state;
    RobotState last;
    do {
      ask_user();
      robot_.wait(options_.sample_period_s);
      last = robot_.read();
      samples.push_back(sample(last));
      state = sensing::settling(samples, plan_.direction, options_.settling);
    } while (!state.settled && last.time_s - start < options_.settling_timeout_s);
    if (!state.settled) report_.unsettled.push_back(next_index_);
    // The recorded force is the mean over the last window, as `settling` sees it.
    Vec3 mean = Vec3::Zero(), square = Vec3::Zero();
    double count = 0;
    for (auto s = samples.rbegin(); s != samples.rend() && s->time_s >= last.time_s - options_.settling.window_s; ++s) {
      mean += s->force_n;
      square += s->force_n.cwiseAbs2();
      ++count;
    }
    mean /= count;
    const Vec3 variance = (square / count - mean.cwiseAbs2()).cwiseMax(0.0);
    const double sigma = std::sqrt(std::max(variance.mean(), free_air_std_n_ * free_air_std_n_ * 0.01) / count);
    history_.insert(history_.end(), samples.begin(), samples.end());
    if (!unloading) watch_out();
    loaded_ = true;
    begin_where_the_force_began();
    report_.deepest_m = std::max(report_.deepest_m, travel(last));  // as it is recorded: a touch of one step tells a stiffness
    record(last, mean, sigma, unloading);
  }

  // Contact is noticed late, by what the threshold needs. Where the force really began is where the best line through zero
  // ends among all samples of the approach and of the rise: force k (depth - begin) beyond it, none before. Travel counts from
  // there.
  void begin_where_the_force_began() {
    if (!begins_late_) return;
    begins_late_ = false;
    approach_.insert(approach_.end(), history_.begin(), history_.end());
    const auto depth_of = [&](const sensing::ContactSample& s) { return plan_.direction.dot(s.tip_m - report_.contact_m); };
    const double least_m = -0.2 * options_.increment_m, step_m = 0.1 * options_.increment_m;
    double best_m = 0, least_squares = std::numeric_limits<double>::infinity();
    for (double late_m = least_m; late_m < options_.search_distance_m; late_m += step_m) {
      double products = 0, squares = 0, total = 0;
      for (const auto& s : approach_) {
        const double force = along(s.force_n), beyond = std::max(0.0, depth_of(s) + late_m);
        products += force * beyond;
        squares += beyond * beyond;
        total += force * force;
      }
      const double left = squares > 0 ? total - products * products / squares : total;
      if (left >= least_squares) continue;
      least_squares = left;
      best_m = late_m;
    }
    report_.contact_m -= best_m * plan_.direction;
    approach_.clear();
  }

  void record(const RobotState& state, const std::optional<Vec3>& force_n, double sigma_n, bool unloading) {
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
    report_.changed_share = sensing::changed_share(before, after);
    report_.came_back = report_.changed_share <= options_.changed_share;
  }

  void go_back_step_by_step() {
    if (recorded_unloading_) return;  // the load that the way back starts from is gone
    const double highest = std::max(report_.highest_force_n, recorded_force_n_);
    for (int k = 1; k <= options_.unloading_steps; ++k) {
      const double target = highest * (1 - double(k) / (options_.unloading_steps + 1));
      while (pressing(robot_.read()) > target && travel(robot_.read()) > 0) {
        step_back();
      }
      const RobotState there = robot_.read();  // once more, for the same reason as on the way in
      if (pressing(there) - 2 * stiffness_n_m(there) * options_.increment_m > lost_n()) step_back();
      if (pressing(robot_.read()) < lost_n()) break;  // the object stayed behind: nothing left to record under load
      settle_and_record(true);
    }
  }

  void step_back() {
    move_to(at_m_ - options_.increment_m, options_.push_speed_m_s);
    robot_.wait(options_.sample_period_s);
  }

  // Away from the object whatever happened, and did it come back?
  void retreat() {
    try {
      move_to(-options_.start_distance_m, options_.approach_speed_m_s);
    } catch (const Stopped& stop) {
      robot_.stop();
      report_.message += "; then " + stop.message;
      return;
    }
    const FreeAir air = listen();
    report_.drift = ForceDrift{(air.mean_n - report_.tare_n) / (air.time_s - tared_at_s_), tared_at_s_};
    report_.drift_n = (air.mean_n - report_.tare_n).norm();
    if (report_.stop != StopReason::no_contact && !recorded_again_) record(air.last, {}, 0, true);
  }

  Robot& robot_;
  const PushPlan& plan_;
  const PushOptions& options_;
  const OnStep& on_step_;
  const std::function<bool()>& keep_going_;
  Push push_;
  PushReport report_;
  std::vector<sensing::ContactSample> history_;  // since contact
  double free_air_std_n_ = 0, tared_at_s_ = 0;
  std::vector<sensing::ContactSample> approach_;  // before contact was noticed
  bool loaded_ = false;       // a step under load is recorded
  bool begins_late_ = false;  // contact was noticed, and is not corrected yet for the force that this took
  double at_m_ = 0;  // commanded, along the push from the expected contact
  std::optional<double> recorded_at_m_;  // of the last loaded step
  int next_index_ = 0;
  double recorded_force_n_ = 0, recorded_travel_m_ = 0;
  bool recorded_rest_ = false, recorded_unloading_ = false, recorded_again_ = false;
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

const char* to_words(StopReason reason) {
  switch (reason) {
    case StopReason::force_limit:
      return "force limit";
    case StopReason::travel_limit:
      return "travel limit";
    case StopReason::slip:
      return "slip";
    case StopReason::contact_lost:
      return "contact lost";
    case StopReason::no_contact:
      return "no contact";
    case StopReason::robot_limit:
      return "limit of the robot";
    case StopReason::user:
      break;
  }
  return "stopped by the user";
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
