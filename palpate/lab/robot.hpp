// SPDX-License-Identifier: Apache-2.0
// A robot made of software: the lab's arm presses a soft cube, with encoders, wrist sensor and depth camera that err as real
// ones do. It implements the interface that a driver of a real arm implements. Seeded and repeatable.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/acquisition/robot.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/lab/depth_sensor.hpp"
#include "palpate/lab/pressed_block.hpp"

namespace palpate::lab {

struct LabOptions {
  std::uint64_t seed = 1;
  PressedBlockOptions object;                                  ///< the truth; nothing that estimates reads it
  double joint_std_rad = 0.02 * 3.14159265358979323846 / 180;  ///< repeat accuracy of the modules, new with each motion
  double force_sigma_n = 0.05;                                 ///< noise of one reading, per axis (wrist sensor)
  double force_unit_n = 0.01;                                  ///< quantisation; 0 = none
  double force_bias_n = 1.0;                                   ///< standard deviation of the untared bias, per axis
  double force_drift_n_s = 0.0002;    ///< standard deviation of the drift a second, per axis (about 0.7 N an hour)
  double relaxation = 0.05;           ///< share of a force's increase that fades after each motion ...
  double relaxation_s = 0.4;          ///< ... with this time constant
  double slip_at_m = 1e9;             ///< travel at which the tip slides off sideways by 5 mm
  std::optional<Pose> T_base_camera;  ///< a camera that stands; not given: one that looks at the object from the side
  DepthSensorOptions depth;
};

/// @throws Error naming the option that is out of range.
void check(const LabOptions& options);

class LabRobot : public acquisition::Robot {
 public:
  explicit LabRobot(const LabOptions& options = {});
  ~LabRobot() override;

  acquisition::RobotState read() override;
  acquisition::Motion move(const Pose& T_base_tip, double speed_m_s) override;
  void stop() override {}
  DepthFrame take_depth_image() override;
  void wait(double duration_s) override;
  double travel_sigma_m() const override;

  /// A recording without pushes: object, support, table, tool, robot and priors, as a person would write them down.
  Recording scene() const;
  /// The push that presses the object where its mesh is fine.
  acquisition::PushPlan plan() const;
  /// What no sensor tells: the force on the object and the travel into it now.
  double true_force_n() const;
  double true_travel_m() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::lab
