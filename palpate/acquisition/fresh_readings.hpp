// SPDX-License-Identifier: Apache-2.0
// A robot whose readings go on. Inner header of the room.
#pragma once

#include "palpate/acquisition/robot.hpp"

namespace palpate::acquisition {

/// Hands every call on. What was read before a motion or a wait says nothing of what came of it: a sensor that stands still would
/// press on blindly. So readings come from after the last wait, and from the last motions; where the sensor is slower than whoever
/// asks, it is waited for.
class FreshReadings : public Robot {
 public:
  /// @param wait_s  between two looks at a sensor that has nothing new
  FreshReadings(Robot& robot, double wait_s) : robot_(robot), wait_s_(wait_s) {}

  /// @throws Error when the clock goes back, or stands still for two seconds of waiting
  RobotState read() override;
  Motion move(const Pose& T_base_tip, double speed_m_s) override;
  void stop() override { robot_.stop(); }
  DepthFrame take_depth_image() override { return robot_.take_depth_image(); }
  void wait(double duration_s) override;
  double travel_sigma_m() const override;
  RobotLimits limits() const override { return robot_.limits(); }
  void on_the_way(bool is) override { robot_.on_the_way(is); }
  std::optional<DepthFrame> look(int view, int views) override { return robot_.look(view, views); }

 private:
  Robot& robot_;
  double wait_s_;
  std::optional<double> read_at_s_;  // by the readings' own clock
  bool waited_ = false;              // since then
  int motions_ = 0;                  // since then
};

}  // namespace palpate::acquisition
