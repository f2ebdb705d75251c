// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/push_protocol.hpp"

#include <cmath>
#include <vector>

#include "palpate/acquisition/fresh_readings.hpp"
#include "palpate/acquisition/guarded_motion.hpp"
#include "palpate/acquisition/push_run.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition {

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

void step_back(Robot& robot, double deep_m, const PushOptions& options, const std::function<bool()>& keep_going) {
  const OnTheWay on_the_way(robot);
  FreshReadings fresh(robot, options.sample_period_s);
  try {
    GuardedMotion motion(fresh, options, [&] {
      if (keep_going && !keep_going()) throw Stopped{StopReason::user, ""};
    });
    Pose back = motion.here();
    back.translation() -= (deep_m + options.start_distance_m) * back.linear().col(2);
    constexpr double felt_m = 0.02;  // what was pressed has come back by then
    motion.go(back, {deep_m + felt_m, deep_m > 0});
  } catch (const Stopped& stop) {
    robot.stop();
    if (stop.reason == StopReason::obstacle) throw Error(stop.message, "robot");
  }
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
