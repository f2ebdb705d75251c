// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/moved_balls.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "palpate/core/error.hpp"
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

bool presses(const Load& load) { return load.force_n && load.force_n->norm() > 0; }

/// As it presses hardest: of a light step sensor noise turns a direction that is that of the force.
const Load& hardest(const Tool& ball, const Push& push) {
  const Load* found = nullptr;
  for (const Step& step : push.steps)
    for (const Load& load : step.loads)
      if (load.tool == ball.name && presses(load) && (found == nullptr || load.force_n->norm() > found->force_n->norm())) found = &load;
  return *found;
}

/// The ball is not there: nothing it does says where it stands or what it weighs.
void take_away(const Tool& ball, Step& step) {
  const bool alone = step.loads.size() == 1;
  const auto of_ball = [&](const std::string& tool) { return tool == ball.name || (tool.empty() && alone); };
  std::erase_if(step.observations, [&](const Observation& one) {
    const auto* wrench = std::get_if<Wrench>(&one);
    const auto* travel = std::get_if<ToolTravel>(&one);
    return (wrench != nullptr && of_ball(wrench->tool)) || (travel != nullptr && of_ball(travel->tool));
  });
  std::erase_if(step.loads, [&](const Load& load) { return load.tool == ball.name; });
}

void move(const Tool& ball, Push& push) {
  constexpr double same_place = 0.05;  // of the radius
  const Load line = hardest(ball, push);
  for (Step& step : push.steps) {
    const auto own = std::find_if(step.loads.begin(), step.loads.end(), [&](const Load& load) { return load.tool == ball.name; });
    if (own == step.loads.end()) continue;
    if (!presses(*own)) {
      take_away(ball, step);
      continue;
    }
    if ((own->contact_m - line.contact_m).norm() > same_place * ball.radius_m)
      throw Error(fmt::format("'{}' presses at another place than in other steps of push '{}'; a rigid tool touches at one place a push: make a push of each "
                              "place, or say where it slid (slipped)",
                              ball.name, push.name),
                  (step.source.empty() ? "push '" + push.name + "'" : step.source) + ": loads.contact_m");
    for (Load& load : step.loads) {
      if (load.tool != ball.name) continue;
      const ToolTravel* travel = observed_travel(step, load);
      load.direction = line.direction;
      load.contact_m = line.contact_m;
      load.travel_m = travel->travel_m;
      observe_force(step, load, *load.force_n);
      load.force_n.reset();
      load.force_std_n = load.force_relative_std = 0;  // force_rate_n_s stays: the clocks' difference is one for all steps
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
