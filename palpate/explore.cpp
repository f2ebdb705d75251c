// SPDX-License-Identifier: Apache-2.0
#include "palpate/explore.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <string_view>
#include <utility>
#include <variant>

#include "palpate/core/error.hpp"
#include "palpate/estimation/target_plan.hpp"

namespace palpate {
namespace {

using estimation::PushRanking;
using estimation::RatedPush;

/// Those of the answer's verdicts that are listed, as words.
std::string said_of(const Identification& answer, std::span<const char* const> codes) {
  std::string said;
  for (const Verdict& verdict : answer.verdicts)
    if (std::find(codes.begin(), codes.end(), verdict.code) != codes.end()) said += (said.empty() ? "" : ", ") + verdict.code;
  return said;
}

/// An interval is not that of what was pushed: the model is another, and no further push changes that.
constexpr const char* model_is_wrong[] = {"model_does_not_fit", "nuisance_beyond_prior", "inverted_elements", "beyond_small_strain", "two_equilibria",
                                          "young_modulus_at_bound", "not_homogeneous", "not_linear", "hysteresis", "not_settled", "object_moved",
                                          "contact_slipped", "contact_elsewhere", "tool_radius_doubtful", "boundary_suspected", "support_gives_way",
                                          "pressure_beyond_model"};
/// An interval is not all that the data allow: another push may tell.
constexpr const char* more_may_tell[] = {"several_minima", "nu_not_explored"};

std::vector<Parameter> parameters(const Identification& answer, const std::string& name) {
  std::vector<Parameter> found;
  for (const auto& one : answer.parameters)
    if (one.name == name) found.push_back(one);
  if (found.empty()) throw Error("holds no " + name, "Identification.parameters");
  return found;
}

class Loop {
 public:
  Loop(acquisition::Robot& robot, const Recording& scene, const ExploreOptions& options, const ExploreHooks& hooks)
      : robot_(robot), options_(options), hooks_(hooks) {
    out_.recording = scene;
    out_.recording.pushes.clear();
    if (options.go_on) earlier_ = scene.pushes;
    if (hooks.on_progress)
      on_progress_ = [this](std::string_view stage, double share) {
        cancelled_ = cancelled_ || !hooks_.on_progress(stage, share);
        return !cancelled_;
      };
    prepare(scene);
  }

  Explored run() {
    if (!take_up()) return end("the pushes of the earlier run are not estimated: stopped on request");
    std::vector<RatedPush> fixed_order;
    while (out_.message.empty()) {
      if (is_stopped()) return end("stopped on request");
      const std::size_t made = out_.pushes.size() + static_cast<std::size_t>(out_.fruitless);
      if (made >= static_cast<std::size_t>(options_.max_pushes)) return end("all pushes are used up");
      const Identification* so_far = out_.pushes.empty() ? nullptr : &out_.identified.answer;
      const PushRanking ranking = suggest(out_.scene, so_far, options_.suggest, on_progress_);
      if (is_stopped()) return end("stopped on request");  // not all were ranked
      std::vector<RatedPush> pushes;
      for (const std::size_t i : estimation::hardest_pushes(ranking)) pushes.push_back(ranking.pushes[i]);
      if (pushes.empty()) return end("no push is possible in view of the camera");
      ExploredPush next;
      if (options_.order == PushOrder::next_best) {
        choose(next, ranking, pushes, options_.max_pushes - static_cast<int>(made));
      } else {
        if (fixed_order.empty()) fixed_order = order_of(ranking.knowledge, pushes);
        next.plan = again(pushes, fixed_order[made % fixed_order.size()]);
      }
      push(next, is_known(ranking.so_far, next.plan.region));
      if (next.report.stop == acquisition::StopReason::user) return end("stopped on request");
      const bool hit = next.report.stop == acquisition::StopReason::obstacle;  // a person looks first
      const std::string what = next.report.message;
      if (!pressed()) {
        if (hit) return end(what);
        ++out_.fruitless;
        forget(next.plan.candidate);
        continue;
      }
      if (!estimate(false)) return end(stopped_in_fit_of(next));
      take_in(std::move(next));
      if (hit) return end(what);
    }
    return end(out_.message);
  }

 private:
  void prepare(const Recording& scene) {
    SuggestOptions suggesting = options_.suggest;
    borne_ = acquisition::within(robot_.limits(), options_.push);
    suggesting.candidates.limits.force_n = std::min(suggesting.candidates.limits.force_n, borne_.force_limit_n);
    suggesting.candidates.limits.travel_m = std::min(suggesting.candidates.limits.travel_m, borne_.travel_limit_m);
    if (options_.go_on) step_back();
    options_.suggest = suggesting;
    // What the robot's own sensors say of themselves.
    const DepthFrame frame = robot_.take_depth_image();
    suggesting.cameras = {frame};
    estimation::SensorPlan sensors;
    sensors.travel_sigma_m = robot_.travel_sigma_m();
    sensors.travel_offset_std_m = acquisition::travel_offset_std_m(options_.push, *sensors.travel_sigma_m);
    const double noise_n = force_noise_n();
    sensors.force_tare_std_n = noise_n / std::sqrt(static_cast<double>(options_.push.free_air_samples));
    const double samples = options_.push.settling.window_s / options_.push.sample_period_s;
    sensors.force_std_n = noise_n / std::sqrt(std::max(1.0, samples));
    sensors.contact_std_m = options_.push.contact_std_m;
    sensors.levels = options_.levels;
    suggesting.sensors = sensors;
    out_.scene = prepare_pushes(scene, suggesting, on_progress_);
  }

  /// Of one reading in free air, per axis.
  double force_noise_n() {
    Vec3 sum = Vec3::Zero(), squares = Vec3::Zero();
    const int count = options_.push.free_air_samples;
    for (int i = 0; i < count; ++i) {
      robot_.wait(options_.push.sample_period_s);
      const Vec3 force = robot_.read().force_n;
      sum += force;
      squares += force.cwiseAbs2();
    }
    const Vec3 variance = (squares / count - (sum / count).cwiseAbs2()).cwiseMax(0.0);
    return std::max(1e-4, std::sqrt(variance.mean()));
  }

  /// A run that was killed has left the tip where it was: the way to the next place must not lead through the object.
  void step_back() {
    const Pose tip = robot_.read().T_base_tip;
    const Vec3 along = tip.linear().col(2);
    double deep_m = 0;
    if (!earlier_.empty() && is_pressed(earlier_.back()))
      deep_m = std::clamp((tip.translation() - last_load(earlier_.back()).contact_m).dot(along), 0.0, borne_.travel_limit_m);
    acquisition::step_back(robot_, deep_m, borne_, hooks_.keep_going);
  }

  static bool is_pressed(const Push& push) {
    return std::any_of(push.steps.begin(), push.steps.end(), [](const Step& step) { return !step.loads.empty(); });
  }
  static const Load& last_load(const Push& pressed) {
    for (auto step = pressed.steps.rbegin();; ++step)
      if (!step->loads.empty()) return step->loads.front();
  }

  /// What an earlier run recorded. @returns false where the user stopped the estimate
  bool take_up() {
    for (const Push& push : earlier_) {
      number_ = std::max(number_ + 1, number_in(push.name));
      if (is_pressed(push)) {
        out_.recording.pushes.push_back(push);
        out_.pushes.push_back(as_recorded(push));
      } else {
        ++out_.fruitless;
        if (!push.steps.empty() && push.steps.front().T_base_tip) forget_before(*push.steps.front().T_base_tip);
      }
    }
    if (out_.pushes.empty()) return true;
    if (!estimate(false)) return false;
    if (judge(out_.pushes.back())) tell_of_last();
    return true;
  }

  static ExploredPush as_recorded(const Push& push) {
    constexpr double unknown = std::numeric_limits<double>::infinity();
    ExploredPush made;
    made.name = push.name;
    made.earlier = true;
    const Load& load = last_load(push);
    made.plan.candidate.contact_m = load.contact_m;
    made.plan.candidate.direction = load.direction;
    made.plan.expected.log_young_std = made.plan.expected.poisson_std = unknown;
    made.found = made.plan.expected;
    made.report.message = "made by an earlier run";
    made.report.contact_m = load.contact_m;
    for (const Step& step : push.steps) {
      if (!step.loads.empty() && step.loads.front().force_n)
        made.report.highest_force_n = std::max(made.report.highest_force_n, step.loads.front().force_n->dot(load.direction));
      for (const Observation& seen : step.observations)
        if (const auto* encoder = std::get_if<ToolTravel>(&seen))
          made.report.deepest_m = std::max(made.report.deepest_m, encoder->travel_m);
    }
    made.plan.force_n = made.report.highest_force_n;
    made.plan.travel_m = made.report.deepest_m;
    return made;
  }

  /// Of "push 7".
  static int number_in(const std::string& name) {
    const std::size_t digits = name.find_last_not_of("0123456789") + 1;
    return digits < name.size() && name.size() - digits < 9 ? std::stoi(name.substr(digits)) : 0;
  }

  /// The place that a tip in front of the object was to push at.
  void forget_before(const Pose& T_base_tip) {
    constexpr double same_m = 0.003;  // an arm repeats to some tenths of a millimetre
    const Vec3 along = T_base_tip.linear().col(2);
    for (const auto& one : out_.scene.candidates) {
      const Vec3 ahead_m = one.contact_m - T_base_tip.translation();
      if (one.direction.dot(along) < 0.999 || (ahead_m - ahead_m.dot(along) * along).norm() > same_m) continue;
      return forget(estimation::PushCandidate(one));
    }
  }

  estimation::SpreadTarget target() const { return {options_.young_modulus_within, options_.poisson_ratio_within}; }

  /// What is pressed on has been felt: forces can be planned.
  static bool is_known(const estimation::ExpectedSpread& spread, int region) {
    constexpr double known = 0.5;  // standard deviation of log E, as Parameter::determined
    return spread.region_log_young_std(region) < known;
  }

  void choose(ExploredPush& next, const PushRanking& ranking, const std::vector<RatedPush>& pushes, int most) const {
    next.plan = pushes.front();
    if (options_.suggest.goal != estimation::PushGoal::both) return;
    const auto plan = estimation::plan_for_target(ranking.knowledge, pushes, target(), most);
    next.plan = pushes[plan.order.front()];
    if (plan.reached) next.pushes_planned = static_cast<int>(plan.order.size());
  }

  std::vector<RatedPush> order_of(const estimation::Knowledge& knowledge, std::vector<RatedPush> pushes) const {
    if (options_.order == PushOrder::best_repeated) {
      const auto plan = estimation::repeat_for_target(knowledge, pushes, target(), 10 * options_.max_pushes);
      return {plan.reached ? pushes[plan.order.front()] : pushes.front()};
    }
    std::mt19937_64 random(options_.seed);
    for (std::size_t i = pushes.size(); i > 1; --i) std::swap(pushes[i - 1], pushes[random() % i]);
    return pushes;
  }

  /// The same place with the forces that are known to be right by now.
  static RatedPush again(const std::vector<RatedPush>& pushes, const RatedPush& wanted) {
    for (const auto& push : pushes)
      if (push.candidate.contact_m == wanted.candidate.contact_m && push.candidate.direction == wanted.candidate.direction)
        return push;
    return wanted;
  }

  void push(ExploredPush& next, bool stiffness_known) {
    acquisition::PushPlan plan = hooks_.plan(next.plan.candidate);
    plan.name = next.name = "push " + std::to_string(++number_);
    if (!plan.around) plan.around = acquisition::keep_out(out_.scene.simulated.surface.rest().vertices_m, out_.scene.object.environment.planes);
    acquisition::PushOptions protocol = options_.push;
    protocol.travel_limit_m = std::min(protocol.travel_limit_m, next.plan.travel_m);
    if (stiffness_known) {
      // Large strains may stiffen the object: the force, too, ends the push.
      protocol.force_limit_n = std::min(protocol.force_limit_n, 1.1 * next.plan.force_n);
      protocol.force_step_n = next.plan.force_n / options_.levels;
    } else {
      next.report = touch(plan, protocol);
      using enum acquisition::StopReason;
      if (next.report.stop == user || next.report.stop == obstacle) return;
      protocol.force_step_n = first_step_n(next.report, protocol);  // of which travel_limit_m is the whole push's
    }
    bool begun = false;
    const auto on_step = [&](const Push& made, const Step& step) {
      if (!begun) {
        out_.recording.pushes.push_back(made);
        out_.recording.pushes.back().steps.clear();
        if (hooks_.on_push_begin) hooks_.on_push_begin(made);
      }
      begun = true;
      out_.recording.pushes.back().steps.push_back(step);
      if (hooks_.on_step) hooks_.on_step(made, step);
    };
    next.report = acquisition::run_push(robot_, plan, protocol, on_step, hooks_.keep_going);
    if (!begun) return;
    if (next.report.drift) take_off(*next.report.drift, out_.recording.pushes.back());
    if (hooks_.on_push_end) hooks_.on_push_end(next.report);
  }

  /// A short touch says how stiff it is there; nothing of it is recorded.
  acquisition::PushReport touch(const acquisition::PushPlan& plan, acquisition::PushOptions protocol) {
    protocol.travel_limit_m = std::min(options_.touch_travel_m, protocol.travel_limit_m);
    protocol.force_step_n = protocol.force_limit_n;
    protocol.unloading_steps = 0;
    return acquisition::run_push(robot_, plan, protocol, {}, hooks_.keep_going);
  }
  double first_step_n(const acquisition::PushReport& touched, const acquisition::PushOptions& protocol) const {
    if (!(touched.highest_force_n > 0) || !(touched.deepest_m > 0)) return options_.push.force_step_n;
    const double whole_m = std::min(protocol.travel_limit_m, borne_.travel_limit_m);
    const double whole_n = touched.highest_force_n / touched.deepest_m * whole_m;
    return std::max(1e-3, std::min(whole_n, borne_.force_limit_n) / options_.levels);
  }

  /// The last push has a loaded step; else it is taken out of the recording again.
  bool pressed() {
    auto& pushes = out_.recording.pushes;
    if (pushes.size() == out_.pushes.size()) return false;
    if (is_pressed(pushes.back())) return true;
    pushes.pop_back();
    return false;
  }

  void forget(const estimation::PushCandidate& candidate) {
    auto& all = out_.scene.candidates;
    all.erase(std::remove_if(all.begin(), all.end(), [&](const auto& one) { return one.contact_m == candidate.contact_m; }),
              all.end());
  }

  bool is_stopped() const { return cancelled_ || (hooks_.keep_going && !hooks_.keep_going()); }

  std::string stopped_in_fit_of(const ExploredPush& last) const {
    return last.name + " is recorded, but " + (out_.pushes.empty() ? "nothing is estimated" : "not in the estimate") + ": stopped on request";
  }

  /// @param whole  with the checks that refit parts of the recording: only the last estimate needs them
  /// @returns false where the user stopped it: what was known before stands
  bool estimate(bool whole) {
    IdentifyOptions options = options_.identify;
    options.fit.cross_checks = whole;
    if (!out_.identified.answer.parameters.empty())
      options.fit.young_start_pa = parameters(out_.identified.answer, "young_modulus").front().value;
    Identified found = identify(out_.recording, options, on_progress_);
    const bool whole_fit = found.answer.termination != Termination::cancelled;
    if (whole_fit || out_.identified.answer.parameters.empty()) out_.identified = std::move(found);
    return whole_fit;
  }

  void take_in(ExploredPush next) {
    if (!judge(next)) return;
    out_.pushes.push_back(std::move(next));
    tell_of_last();
  }

  /// @returns false where there is no estimate to judge by
  bool judge(ExploredPush& next) {
    const Identification& answer = out_.identified.answer;
    if (answer.parameters.empty()) {
      out_.message = "the estimate did not work out: " + answer.message;
      return false;
    }
    next.young_moduli = parameters(answer, "young_modulus");
    next.poisson_ratio = parameters(answer, "poisson_ratio").front();
    next.found = estimation::expected_after(estimation::after_fit(out_.recording, answer), {});
    look_at_goal(next);
    return true;
  }

  /// Narrow intervals are the goal where they can be believed.
  void look_at_goal(const ExploredPush& last) {
    const Identification& answer = out_.identified.answer;
    narrow_ = young_modulus_half_width(last) <= options_.young_modulus_within &&
              poisson_ratio_half_width(last.poisson_ratio) <= options_.poisson_ratio_within;
    in_the_way_ = said_of(answer, model_is_wrong);
    out_.reached = narrow_ && answer.termination == Termination::converged && in_the_way_.empty() && said_of(answer, more_may_tell).empty();
  }

  /// Of narrow intervals; empty where another push may still do.
  std::string words_of_goal() const {
    const std::string narrow = std::string(out_.pushes.back().young_moduli.size() == 1 ? "both" : "all") + " intervals are as narrow as was asked for";
    if (out_.reached) return narrow;
    return in_the_way_.empty() ? "" : narrow + ", but not to be believed: " + in_the_way_;
  }

  void tell_of_last() {
    if (hooks_.on_push) hooks_.on_push(out_.pushes.back());
    if (narrow_) out_.message = words_of_goal();
  }

  /// Nobody pushes for it: what every push tells is known by now, and a list begins where this loop began.
  void expect_fixed_lists() {
    const PushRanking ranking = suggest(out_.scene, &out_.identified.answer, options_.suggest, on_progress_);
    if (is_stopped()) return;
    std::vector<RatedPush> pushes;
    for (const std::size_t i : estimation::hardest_pushes(ranking)) pushes.push_back(ranking.pushes[i]);
    if (pushes.empty()) return;
    estimation::Knowledge fresh = estimation::before_touch(out_.scene.object, ranking.knowledge.young_modulus_pa);
    fresh.poisson_ratio = ranking.knowledge.poisson_ratio;
    fresh.log_ratio = ranking.knowledge.log_ratio;
    fresh.uncured = ranking.knowledge.uncured;
    fresh = estimation::with_shared(std::move(fresh), ranking.knowledge.information.diagonal().tail(ranking.knowledge.shared));
    FixedLists lists;
    const int most = 10 * options_.max_pushes;
    lists.candidates = static_cast<int>(pushes.size());
    lists.random = estimation::shuffled_for_target(fresh, pushes, target(), most, options_.seed);
    const auto again = estimation::repeat_for_target(fresh, pushes, target(), most);
    if (again.reached) lists.repeated = static_cast<int>(again.order.size());
    out_.fixed_lists = lists;
  }

  Explored end(const std::string& message) {
    out_.message = message;
    const bool at_goal = narrow_ && message == words_of_goal();
    if (!out_.pushes.empty() && !out_.pushes.back().young_moduli.empty() && !is_stopped()) expect_fixed_lists();
    if (!options_.identify.fit.cross_checks || out_.pushes.empty() || is_stopped()) return std::move(out_);
    if (estimate(true))
      judge_at_last(at_goal);
    else
      out_.message = "stopped on request in the last checks: " + message;
    return std::move(out_);
  }

  /// The last estimate has all checks: what they say, and unknowns that they add (a slip), decide whether the goal is reached.
  void judge_at_last(bool was_at_goal) {
    const Identification& answer = out_.identified.answer;
    const bool before = std::exchange(out_.reached, false);
    if (answer.parameters.empty()) {
      out_.message = "the last estimate did not work out: " + answer.message;
      return;
    }
    ExploredPush last;
    last.young_moduli = parameters(answer, "young_modulus");
    last.poisson_ratio = parameters(answer, "poisson_ratio").front();
    look_at_goal(last);
    if (narrow_ && (was_at_goal || (out_.reached && !before))) {
      const std::string words = words_of_goal();
      const std::string open = said_of(answer, more_may_tell);
      out_.message = !words.empty() ? words
                     : open.empty() ? "the last estimate did not come to its end: " + answer.message
                                    : "the intervals are narrow, but not all that the data allow: " + open;
    } else if (was_at_goal) {
      out_.message = "the intervals are wider than was asked for, once all checks are made";
    }
  }

  acquisition::Robot& robot_;
  ExploreOptions options_;
  acquisition::PushOptions borne_;  // of options_.push, what the robot bears
  const ExploreHooks& hooks_;
  OnProgress on_progress_;  // the hook's
  bool cancelled_ = false;  // by it
  std::vector<Push> earlier_;
  int number_ = 0;  // of the last push
  bool narrow_ = false;     // the intervals of the last estimate
  std::string in_the_way_;  // its verdicts for which they are not to be believed
  Explored out_;
};

}  // namespace

void check(const ExploreOptions& o) {
  const auto need = [](bool good, const char* field, const char* rule) {
    if (!good) throw Error(rule, std::string("ExploreOptions.") + field);
  };
  need(o.young_modulus_within > 0, "young_modulus_within", "must be positive");
  need(o.poisson_ratio_within > 0, "poisson_ratio_within", "must be positive");
  need(o.max_pushes >= 1, "max_pushes", "must be at least 1");
  need(o.levels >= 1, "levels", "must be at least 1");
  need(o.touch_travel_m > 0, "touch_travel_m", "must be positive");
  need(o.identify.method == "palpate", "identify.method", "must be palpate: the paper's has no interval");
  acquisition::check(o.push);
  estimation::check(o.suggest.candidates);
}

double young_modulus_half_width(const Parameter& young) { return 0.5 * (young.upper_95 - young.lower_95) / young.value; }
double young_modulus_half_width(const ExploredPush& push) {
  double widest = push.young_moduli.empty() ? std::numeric_limits<double>::infinity() : 0;
  for (const Parameter& one : push.young_moduli) widest = std::max(widest, young_modulus_half_width(one));
  return widest;
}
double poisson_ratio_half_width(const Parameter& ratio) { return 0.5 * (ratio.upper_95 - ratio.lower_95); }

Explored explore(acquisition::Robot& robot, const Recording& scene, const ExploreOptions& options,
                 const ExploreHooks& hooks) {
  check(options);
  if (!hooks.plan) throw Error("must say how the robot makes a push", "ExploreHooks.plan");
  return Loop(robot, scene, options, hooks).run();
}

}  // namespace palpate
