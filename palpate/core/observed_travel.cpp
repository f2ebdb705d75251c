// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/observed_travel.hpp"

namespace palpate {

const ToolTravel* observed_travel(const Step& step, const Load& load) {
  for (const Observation& one : step.observations) {
    const auto* travel = std::get_if<ToolTravel>(&one);
    if (travel != nullptr && (travel->tool.empty() || travel->tool == load.tool)) return travel;
  }
  return nullptr;
}

bool shows_what_it_touches(const Tool& ball, const Push& push) {
  if (ball.shape != ToolShape::sphere || !(ball.radius_m > 0) || ball.radius_std_m > 0) return false;
  bool presses = false;
  for (const Step& step : push.steps) {
    if (step.slipped) return false;
    for (const Load& load : step.loads) {
      if (load.tool != ball.name) continue;
      if (load.travel_m) return false;
      if (!load.force_n || load.force_n->norm() == 0) continue;
      if (observed_travel(step, load) == nullptr) return false;
      presses = true;
    }
  }
  return presses;
}

}  // namespace palpate
