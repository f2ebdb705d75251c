// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <optional>
#include <utility>

#include "palpate/acquisition/robot.hpp"

namespace palpate::cli {

/// A robot whose clock begins no earlier than it is told: a recording that goes on must not go back in time, and a robot may have
/// been switched off in between.
class LaterRobot : public acquisition::Robot {
 public:
  /// @param not_before_s  0: its clock is left as it is
  LaterRobot(acquisition::Robot& robot, double not_before_s)
      : robot_(robot), later_s_(not_before_s > 0 ? std::max(0.0, not_before_s - robot.read().time_s) : 0) {}

  acquisition::RobotState read() override {
    acquisition::RobotState state = robot_.read();
    state.time_s += later_s_;
    return state;
  }
  acquisition::Motion move(const Pose& T_base_tip, double speed_m_s) override { return robot_.move(T_base_tip, speed_m_s); }
  void stop() override { robot_.stop(); }
  DepthFrame take_depth_image() override { return later(robot_.take_depth_image()); }
  void wait(double duration_s) override { robot_.wait(duration_s); }
  double travel_sigma_m() const override { return robot_.travel_sigma_m(); }
  acquisition::RobotLimits limits() const override { return robot_.limits(); }
  void on_the_way(bool is) override { robot_.on_the_way(is); }
  std::optional<DepthFrame> look(int view, int views) override {
    std::optional<DepthFrame> frame = robot_.look(view, views);
    if (frame) *frame = later(std::move(*frame));
    return frame;
  }

 private:
  DepthFrame later(DepthFrame frame) const {
    frame.time_s += later_s_;
    return frame;
  }

  acquisition::Robot& robot_;
  double later_s_;
};

}  // namespace palpate::cli
