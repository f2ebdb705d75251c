// SPDX-License-Identifier: Apache-2.0
#include "python/robot.hpp"

#include <cmath>
#include <filesystem>
#include <limits>
#include <string_view>
#include <system_error>
#include <utility>

#include "cli/new_folder.hpp"
#include "cli/paths.hpp"
#include "cli/push_words.hpp"
#include "palpate/io/recording.hpp"
#include "python/arguments.hpp"
#include "python/python_calls.hpp"
#include "python/robot_checks.hpp"

namespace palpate::python {
namespace {

/// What Python raises goes through the library, which stops the robot first, and takes its tip away where the robot was at fault.
class PythonRobot : public acquisition::Robot {
 public:
  PythonRobot(py::object robot, PythonProgress& asks) : robot_(std::move(robot)), asks_(asks) {
    for (const char* call : {"read", "move", "stop", "take_depth_image", "wait", "travel_sigma_m"})
      if (!py::hasattr(robot_, call)) throw Error(std::string("has no `") + call + "`: derive it from palpate.Robot", "robot");
    travel_sigma_m_ = from_python<double>(robot_.attr("travel_sigma_m"), Place("robot.travel_sigma_m"));
    if (!(travel_sigma_m_ > 0) || !std::isfinite(travel_sigma_m_))
      throw Error("must be positive: how well the encoders know where the tip is along a push, in metres", "robot.travel_sigma_m");
  }
  acquisition::RobotState read() override {
    return asks_.call([&] {
      auto state = from_python<acquisition::RobotState>(robot_.attr("read")(), Place("robot.read()"));
      check_state(state, clock_s_);
      return state;
    });
  }
  acquisition::Motion move(const Pose& T_base_tip, double speed_m_s) override {
    return asks_.call([&] {
      const py::object moved = robot_.attr("move")(to_python(T_base_tip), speed_m_s);
      return moved.is_none() || from_python<bool>(moved, Place("robot.move()")) ? acquisition::Motion::done : acquisition::Motion::refused;
    });
  }
  void stop() override {
    asks_.call([&] { robot_.attr("stop")(); });
  }
  DepthFrame take_depth_image() override {
    return asks_.call([&] {
      return checked_frame(from_python<DepthFrame>(robot_.attr("take_depth_image")(), Place("robot.take_depth_image()")), "take_depth_image");
    });
  }
  void wait(double duration_s) override {
    asks_.call([&] { robot_.attr("wait")(duration_s); });
  }
  double travel_sigma_m() const override { return travel_sigma_m_; }
  acquisition::RobotLimits limits() const override {
    return asks_.call([&] {
      if (!py::hasattr(robot_, "limits")) return acquisition::RobotLimits{};
      const auto limits = from_python<acquisition::RobotLimits>(robot_.attr("limits"), Place("robot.limits"));
      check_limits(limits);
      return limits;
    });
  }
  std::optional<DepthFrame> look(int view, int views) override {
    return asks_.call([&] {
      if (!py::hasattr(robot_, "look")) return std::optional<DepthFrame>{};
      auto frame = from_python<std::optional<DepthFrame>>(robot_.attr("look")(view, views), Place("robot.look()"));
      return frame ? std::optional(checked_frame(std::move(*frame), "look")) : std::nullopt;
    });
  }
  bool reaches(const Pose& T_base_tip) const {
    return asks_.call([&] { return !py::hasattr(robot_, "reaches") || from_python<bool>(robot_.attr("reaches")(to_python(T_base_tip)), Place("robot.reaches()")); });
  }

 private:
  py::object robot_;
  PythonProgress& asks_;
  double travel_sigma_m_ = 0;
  double clock_s_ = -std::numeric_limits<double>::infinity();
};

acquisition::PushOptions push_options(Options& from) {
  acquisition::PushOptions options;
  from.take("force_limit_n", options.force_limit_n);
  from.take("travel_limit_m", options.travel_limit_m);
  from.take("force_step_n", options.force_step_n);
  from.take("unloading_steps", options.unloading_steps);
  from.take("start_distance_m", options.start_distance_m);
  from.take("search_distance_m", options.search_distance_m);
  from.take("increment_m", options.increment_m);
  from.take("clearance_m", options.clearance_m);
  from.take("tool_length_m", options.tool_length_m);
  from.take("approach_speed_m_s", options.approach_speed_m_s);
  from.take("push_speed_m_s", options.push_speed_m_s);
  from.take("sample_period_s", options.sample_period_s);
  from.take("free_air_samples", options.free_air_samples);
  from.take("look_every_m", options.look_every_m);
  from.take("blind_retreat_m", options.blind_retreat_m);
  from.take("obstacle_threshold_n", options.obstacle_threshold_n);
  from.take("settling_rate_n_s", options.settling.rate_n_s);
  from.take("settling_relative_rate_s", options.settling.relative_rate_s);
  from.take("settling_window_s", options.settling.window_s);
  from.take("settling_timeout_s", options.settling_timeout_s);
  from.take("contact_std_m", options.contact_std_m);
  from.take("contact_threshold_n", options.contact.threshold_n);
  from.take("contact_noise_factor", options.contact.noise_factor);
  from.take("contact_samples", options.contact.confirm_samples);
  from.take("slip_sideways_m", options.slip.tangential_m);
  from.take("slip_friction", options.slip.friction_limit);
  from.take("slip_force_drop", options.slip.force_drop);
  from.take("slip_deeper_m", options.slip.deeper_m);
  from.take("slip_least_force_n", options.slip.least_force_n);
  from.take("changed_share", options.changed_share);
  return options;
}

/// What the program says after a push. It names its options, which are arguments here.
std::vector<std::string> push_warnings(const std::string& name, const acquisition::PushReport& report) {
  constexpr std::pair<std::string_view, std::string_view> arguments[] = {
      {"--increment", "increment_m"}, {"--push-speed", "push_speed_m_s"}, {"--blind-retreat", "blind_retreat_m"}};
  std::vector<std::string> warnings = cli::push_warnings(name, report);
  for (std::string& text : warnings)
    for (const auto& [option, argument] : arguments)
      if (const auto at = text.find(option); at != std::string::npos) text.replace(at, option.size(), argument);
  return warnings;
}

/// @throws Error where the scene has no such tool
std::string tool_of(const Recording& scene, std::string asked) {
  if (scene.tools.empty()) throw Error("names no tool", "scene.tools");
  if (asked.empty()) return scene.tools.front().name;
  for (const Tool& tool : scene.tools)
    if (tool.name == asked) return asked;
  throw Error("is no tool of the scene; its first is '" + scene.tools.front().name + "'", "tool");
}

acquisition::PushPlan plan_of(const Recording& scene, const std::string& tool, const Vec3& contact_m, const Vec3& direction) {
  acquisition::PushPlan plan;
  plan.tool = tool;
  plan.contact_m = contact_m;
  plan.direction = direction;
  plan.R_base_tip = acquisition::tip_along(direction);
  plan.around = acquisition::keep_out(scene);
  return plan;
}

void tell(PythonProgress& asks, const py::object& callable, const Push& push, const Step& step) {
  asks.call([&] {
    if (!callable.is_none()) callable(push.name, to_python(step));
  });
}

/// What `explore` leaves on the disk: nothing, where nothing was recorded.
struct Kept {
  Kept(const std::filesystem::path& out, const Recording& scene) : folder(out), recording(out, scene) {}
  cli::NewFolder folder;
  io::RecordingWriter recording;
};

/// @throws Error where something is in it: of a recording that is written over nothing would be left
void must_be_new(const std::filesystem::path& folder) {
  cli::must_take_files(folder);
  std::error_code code;
  if (std::filesystem::exists(folder, code) && !std::filesystem::is_empty(folder, code))
    throw Error("is there already; choose another folder or remove it", folder.string());
}

LoopPush loop_push(const ExploredPush& push, const PushScene& scene) {
  return {push.name, suggested(push.plan, scene), made_push(push.report), push.young_moduli, push.poisson_ratio};
}

}  // namespace

MadePush made_push(const acquisition::PushReport& report) {
  return {acquisition::to_words(report.stop), report.message, acquisition::is_at_a_limit(report.stop), report.contact_m, report.highest_force_n,
          report.deepest_m, report.overshoot_n, report.steps, report.blank_images, report.unsettled, report.compared, report.came_back,
          report.changed_share, report.drift_n, report.turned_rad, report.blind_retreat_m};
}

py::object push_with(const py::object& robot, const py::object& given, const py::dict& options, const py::object& on_step, const py::object& progress) {
  const Recording scene = recording_of(given, "scene");
  Vec3 contact_m = Vec3::Zero(), direction = -Vec3::UnitZ();
  std::string tool, name, site;
  Options from(options);
  from.take("contact_m", contact_m);
  from.take("direction", direction);
  from.take("tool", tool);
  from.take("name", name);
  from.take("site", site);
  const acquisition::PushOptions asked = push_options(from);
  from.all_taken();
  if (!contact_m.allFinite()) throw Error("must be finite", "contact_m");
  if (!(direction.norm() > 0)) throw Error("must not be zero", "direction");
  acquisition::PushPlan plan = plan_of(scene, tool_of(scene, tool), contact_m, direction.normalized());
  plan.name = name.empty() ? "push " + std::to_string(scene.pushes.size() + 1) : name;
  plan.site = site;
  PythonProgress asks(progress);
  PythonRobot arm(robot, asks);
  Push made;
  const acquisition::PushReport report = without_lock(asks, [&] {
    std::vector<Step> steps;
    acquisition::PushReport of_push = acquisition::run_push(
        arm, plan, asked,
        [&](const Push& push, const Step& step) {
          made = push;
          steps.push_back(step);
          tell(asks, on_step, push, step);
        },
        [&] { return asks.go_on(); });
    made.steps = std::move(steps);
    if (of_push.drift) take_off(*of_push.drift, made);
    return of_push;
  });
  warn_of(push_warnings(plan.name, report));
  return py::make_tuple(to_python(made), to_python(made_push(report)));
}

py::object explore_with(const py::object& robot, const py::object& given, const py::object& folder, const py::dict& options, const py::object& on_step,
                        const py::object& on_push, const py::object& progress) {
  Recording scene = recording_of(given, "scene");
  scene.pushes.clear();  // of another day; the folder gets those that are made now
  ExploreOptions asked;
  std::string tool, goal = "both";
  int seed = 1;
  Options from(options);
  from.take("young_modulus_within", asked.young_modulus_within);
  from.take("poisson_ratio_within", asked.poisson_ratio_within);
  from.take("max_pushes", asked.max_pushes);
  from.take("levels", asked.levels);
  from.take("goal", goal);
  from.take("tool", tool);
  from.take("young_modulus_pa", asked.suggest.young_modulus_pa);
  from.take("contacts", asked.suggest.candidates.contacts);
  from.take("tilts", asked.suggest.candidates.tilts);
  from.take("seed", seed);
  asked.push = push_options(from);
  asked.identify = identify_options(from);
  from.all_taken();
  asked.suggest.goal = estimation::push_goal(goal);
  asked.suggest.tool = tool_of(scene, tool);
  asked.suggest.threads = asked.identify.fit.threads;
  asked.suggest.candidates.seed = asked.seed = static_cast<std::uint64_t>(seed);
  check(asked);
  PythonProgress asks(progress);
  PythonRobot arm(robot, asks);
  asked.suggest.candidates.reachable = [&](const Vec3& contact_m, const Vec3& direction) {
    Pose pose = Pose::Identity();
    pose.linear() = acquisition::tip_along(direction);
    for (const double before_m : {asked.push.start_distance_m, 0.0}) {
      pose.translation() = contact_m - before_m * direction;
      if (!arm.reaches(pose)) return false;
    }
    return true;
  };
  std::optional<Kept> kept;
  if (!folder.is_none()) {
    must_be_new(path_of(folder));
    kept.emplace(path_of(folder), scene);
  }
  ExploreHooks hooks;
  hooks.plan = [&](const estimation::PushCandidate& at) {
    acquisition::PushPlan plan = plan_of(scene, asked.suggest.tool, at.contact_m, at.direction);
    plan.name = "push";
    return plan;
  };
  std::string pushing;
  hooks.on_push_begin = [&](const Push& push) {
    pushing = push.name;
    if (kept) kept->recording.begin_push(push);
  };
  hooks.on_step = [&](const Push& push, const Step& step) {
    if (kept) {
      kept->recording.add_step(step);
      kept->folder.keep();
    }
    tell(asks, on_step, push, step);
  };
  hooks.on_push_end = [&](const acquisition::PushReport& report) {
    if (kept && report.drift) kept->recording.end_push(*report.drift);
    asks.call([&] { warn_of(push_warnings(pushing, report)); });
  };
  hooks.on_push = [&](const ExploredPush& push) {
    asks.call([&] {
      if (!on_push.is_none()) on_push(push.name, to_python(push.young_moduli), to_python(push.poisson_ratio));
    });
  };
  hooks.keep_going = [&] { return asks.go_on(); };
  hooks.on_progress = asks.callback();
  const Loop out = without_lock(asks, [&] {
    Explored done = explore(arm, scene, asked, hooks);
    Loop told;
    for (const ExploredPush& push : done.pushes) told.pushes.push_back(loop_push(push, done.scene));
    told.recording = std::move(done.recording);
    if (told.recording.source == "scene") told.recording.source.clear();  // it came from nowhere
    told.found = std::move(done.identified);
    told.fruitless = done.fruitless;
    told.reached = done.reached;
    told.message = std::move(done.message);
    return told;
  });
  return to_python(out);
}

py::object look_around_with(const py::object& robot, int views) {
  PythonProgress asks{py::none()};
  PythonRobot arm(robot, asks);
  const auto frames = without_lock(asks, [&] { return acquisition::look_around(arm, views, [&] { return asks.go_on(); }); });
  if (!frames) throw Error("does not carry its camera around: it has no `look`, or that gives None", "robot");
  return to_python(*frames);
}

}  // namespace palpate::python
