// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/moved_balls.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "palpate/core/observed_travel.hpp"

namespace palpate::estimation {
namespace {

/// Along the push alone: what it drags across tells next to nothing of E, and a ball that is moved goes straight.
void observe_force(Step& step, const Load& load, const Vec3& force_n) {
  constexpr double exact = 1e-3;  // of the force, where it is said to be exactly known
  Wrench read;
  read.tool = load.tool;
  read.time_s = step.time_s;
  read.along = load.direction.normalized();
  read.force_n = read.along.dot(force_n) * read.along;
  read.force_sigma_n = std::hypot(load.force_std_n, load.force_relative_std * force_n.norm());
  std::vector<Observation> seen;
  for (Observation& one : step.observations) {
    const auto* wrench = std::get_if<Wrench>(&one);
    if (wrench == nullptr || !(wrench->tool.empty() || wrench->tool == load.tool)) seen.push_back(std::move(one));
    else if (read.force_sigma_n == 0 && wrench->force_sigma_n > 0) read.force_sigma_n = wrench->force_sigma_n;
  }
  read.force_sigma_n = std::max(read.force_sigma_n, exact * force_n.norm());
  seen.push_back(read);
  step.observations = std::move(seen);
}

void move(const Tool& ball, Push& push) {
  for (Step& step : push.steps) {
    for (Load& load : step.loads) {
      if (load.tool != ball.name) continue;
      const ToolTravel* travel = observed_travel(step, load);
      const Vec3 force_n = load.force_n.value_or(Vec3::Zero());
      const bool presses = force_n.norm() > 0;
      if (presses) observe_force(step, load, force_n);
      load.travel_m = presses ? travel->travel_m : 0;
      load.force_n.reset();
      load.force_std_n = load.force_relative_std = 0;
      load.force_rate_n_s.setZero();
    }
  }
}

}  // namespace

Recording with_balls_moved(Recording recording) {
  if (recording.free) return recording;
  for (const Tool& ball : recording.tools) {
    bool moved = false;
    for (Push& push : recording.pushes) {
      if (!shows_what_it_touches(ball, push)) continue;
      move(ball, push);
      moved = true;
    }
    if (moved)
      recording.warnings.push_back("'" + ball.name +
                                   "' is a ball, which touches more the deeper it goes: its travel moves it as a rigid body, and its force along the push is "
                                   "what was observed. Where it presses a patch that is known, give a disc, or radius_std_m");
  }
  return recording;
}

}  // namespace palpate::estimation
