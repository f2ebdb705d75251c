// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/robot.hpp"

#include <utility>

#include "palpate/core/error.hpp"

namespace palpate::acquisition {

void check(const RobotLimits& limits) {
  const auto need = [](double limit, const char* field) {
    if (!(limit > 0)) throw Error("must be positive; infinite where the robot has no such limit", std::string("RobotLimits.") + field);
  };
  need(limits.force_n, "force_n");
  need(limits.travel_m, "travel_m");
  need(limits.speed_m_s, "speed_m_s");
}

std::optional<std::vector<DepthFrame>> look_around(Robot& robot, int views, const std::function<bool()>& keep_going) {
  if (views < 1) throw Error("must be at least 1", "views");
  std::vector<DepthFrame> frames;
  try {
    for (int view = 0; view < views; ++view) {
      if (keep_going && !keep_going()) {
        robot.stop();
        break;
      }
      std::optional<DepthFrame> frame = robot.look(view, views);
      if (!frame) return std::nullopt;
      frames.push_back(std::move(*frame));
    }
  } catch (...) {
    try {
      robot.stop();
    } catch (...) {  // says less than what broke first
    }
    throw;
  }
  return frames;
}

}  // namespace palpate::acquisition
