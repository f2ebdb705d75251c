// SPDX-License-Identifier: Apache-2.0
// From what a wrist sensor reads to the wrench of the tool on the object: bias and tool weight found from a few orientations
// in free air, taken off, and moved to the tip in the base frame.
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

/// One reading in the sensor's own frame. Sign: the force that the tool's side exerts on the sensor, as sensors report it:
/// a tool hanging at rest reads its own weight.
struct WrenchReading {
  double time_s = 0;
  Vec3 force_n = Vec3::Zero();
  Vec3 torque_nm = Vec3::Zero();
  Mat3 R_base_sensor = Mat3::Identity();
};

/// What the sensor reads without contact: bias + weight of the tool.
struct ToolWeight {
  double mass_kg = 0;
  Vec3 centre_m = Vec3::Zero();      ///< of mass, sensor frame
  Vec3 force_bias_n = Vec3::Zero();  ///< tare
  Vec3 torque_bias_nm = Vec3::Zero();
  double mass_std_kg = 0;
  Vec3 centre_std_m = Vec3::Zero();
  Vec3 force_bias_std_n = Vec3::Zero();
  double force_rms_n = 0, torque_rms_nm = 0;  ///< of the fit's residuals
};

/// Least squares over readings in free air. Three orientations that differ by tens of degrees about two axes determine it.
/// @throws Error when gravity is zero, or the orientations are too alike to tell weight from bias (says what to do).
ToolWeight calibrate_tool(const std::vector<WrenchReading>& free_air, const Vec3& gravity_m_s2);

/// Bias alone, for a tool of known mass and centre: a quick tare before a push.
ToolWeight tare(ToolWeight tool, const std::vector<WrenchReading>& free_air, const Vec3& gravity_m_s2);

/// Wrench of the tool on the object, base axes, torque about the tip. `T_sensor_tip`: only its origin matters.
Wrench wrench_at_tip(const WrenchReading& reading, const ToolWeight& tool, const Vec3& gravity_m_s2,
                     const Vec3& tip_in_sensor_m);

/// Moves a wrench's torque to another point (same axes): torque + (from - to) x force.
Vec3 torque_about(const Vec3& torque_nm, const Vec3& force_n, const Vec3& from_m, const Vec3& to_m);

}  // namespace palpate::sensing
