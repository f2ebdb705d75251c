// SPDX-License-Identifier: Apache-2.0
// The loop on a robot that presses the small block, as the tests of `explore` run it.
#pragma once

#include <cstddef>
#include <functional>
#include <string_view>

#include "block_robot.hpp"
#include "palpate/explore.hpp"

namespace palpate {

inline ExploreOptions loop_options() {
  ExploreOptions options;
  options.young_modulus_within = 0.04;
  options.poisson_ratio_within = 0.014;
  options.max_pushes = 12;
  options.levels = 2;
  options.suggest.candidates.contacts = 8;
  options.suggest.candidates.tilts = 1;
  options.push.unloading_steps = 0;
  options.push.contact_std_m = 1e-3;
  options.push.settling_timeout_s = 3;
  options.identify.fit.cross_checks = false;
  return options;
}

struct Tried {
  Explored found;
  int begun = 0, steps = 0, told = 0;
};

/// @param keep_going  told what was made so far  @param scene  nullptr: the robot's own
/// @param go_on       told that, too, and the stage of the work that it may stop
inline Tried explored(BlockRobot& robot, const ExploreOptions& options, const std::function<bool(const Tried&)>& keep_going = {},
                      const Recording* scene = nullptr, const std::function<bool(const Tried&, std::string_view)>& go_on = {}) {
  Tried run;
  ExploreHooks hooks;
  hooks.plan = [&](const estimation::PushCandidate& at) { return robot.plan(at); };
  hooks.on_push_begin = [&](const Push&) { ++run.begun; };
  hooks.on_step = [&](const Push&, const Step&) { ++run.steps; };
  hooks.on_push = [&](const ExploredPush&) { ++run.told; };
  if (keep_going) hooks.keep_going = [&] { return keep_going(run); };
  if (go_on) hooks.on_progress = [&](std::string_view stage, double) { return go_on(run, stage); };
  run.found = explore(robot, scene != nullptr ? *scene : robot.scene(), options, hooks);
  return run;
}

inline std::size_t count(const Explored& run) { return run.pushes.size() + static_cast<std::size_t>(run.fruitless); }

}  // namespace palpate
