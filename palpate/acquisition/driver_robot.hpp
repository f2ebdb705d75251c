// SPDX-License-Identifier: Apache-2.0
// A robot that a driver brings (driver.h), as the protocol wants it.
#pragma once

#include <string>

#include "palpate/acquisition/driver.h"
#include "palpate/acquisition/robot.hpp"

namespace palpate::acquisition {

/// The driver's entry point, wherever it was found.
using MakeRobot = int (*)(std::uint32_t abi, const char* settings, PalpateRobot* robot, char* error, std::size_t error_size);

/// Checks everything that comes out of the driver. What it says wrong is an Error that names call and field. Drivers of every
/// version of driver.h up to this one are used; what theirs did not have yet, they cannot do.
class DriverRobot : public Robot {
 public:
  /// @param name  of the driver, for messages
  /// @throws Error when the driver is of another version, leaves a call out, or cannot start.
  DriverRobot(MakeRobot make, const std::string& settings, std::string name);
  ~DriverRobot() override;
  DriverRobot(const DriverRobot&) = delete;
  DriverRobot& operator=(const DriverRobot&) = delete;

  RobotState read() override;
  Motion move(const Pose& T_base_tip, double speed_m_s) override;
  void stop() override;
  DepthFrame take_depth_image() override;
  void wait(double duration_s) override;
  double travel_sigma_m() const override;
  RobotLimits limits() const override;
  std::optional<DepthFrame> look(int view, int views) override;
  /// True where the driver cannot say.
  bool reaches(const Pose& T_base_tip) const;

 private:
  DepthFrame frame_of(const char* call, const PalpateDepthImage& given) const;
  [[noreturn]] void failed(const char* call, const std::string& what) const;
  void expect_done(const char* call, int answer) const;
  Pose pose_of(const char* call, const char* field, const PalpatePose& pose) const;

  std::string name_;
  PalpateRobot robot_{};
  double clock_s_ = -1e300;
};

}  // namespace palpate::acquisition
