// SPDX-License-Identifier: Apache-2.0
// Wrist sensors of force and torque: what they make of true ones.
#pragma once

#include <span>
#include <string_view>

#include "palpate/core/math.hpp"
#include "palpate/lab/random.hpp"

namespace palpate::lab {

struct ForceSensorOptions {
  double sigma_n = 0.05;        ///< noise of one reading, per axis
  double unit_n = 0.01;         ///< quantisation; 0 = none
  double range_n = 300;         ///< readings end there
  double range_along_n = 300;   ///< along the hand's axis
  double bias_n = 1.0;          ///< standard deviation of the untared bias, per axis
  double drift_n_s = 0.0002;    ///< standard deviation of the drift a second, per axis (about 0.7 N an hour)
  double scale_std = 0.01;      ///< of the common scale error, which a recording states
  double cross_talk_std = 0;    ///< of each entry beside the diagonal: of forces in forces, of torques in torques, and of forces in
                                ///< torques as a share of the ranges (range_along_n, torque_range_nm)
  double tool_mass_kg = 0.3;    ///< what hangs on it: a constant force in the base frame, part of the tare of every push
  double tool_centre_m = 0.15;  ///< where its weight acts, along the hand's axis
  double torque_sigma_nm = 0.002, torque_unit_nm = 0.0005, torque_range_nm = 10, torque_bias_nm = 0.05;  ///< as of the force
  double torque_drift_nm_s = 5e-6;
};

struct ForceSensorModel {
  std::string_view name;
  std::string_view source;
  ForceSensorOptions options;
};

/// The table that --help and the tests loop over.
std::span<const ForceSensorModel> force_sensors();

/// @throws Error listing the names when there is none of that name.
ForceSensorOptions force_sensor(std::string_view name);

/// @throws Error naming the option that is out of range.
void check(const ForceSensorOptions& options);

/// The highest force along the hand that is told whatever else the sensor bears: the tool's weight, and a zero that nobody knows
/// beforehand.
double readable_along_n(const ForceSensorOptions& options);

/// One sensor as it came out of the box: bias, drift, scale and cross-talk are drawn once, along its own axes.
class ForceSensor {
 public:
  /// @param of_torque  what differs from box to box of the torque has draws of its own: the force does not change with it
  ForceSensor(const ForceSensorOptions& options, Random& once, Random of_torque = Random(0));
  /// @param true_force_n  of the tool on the object, base frame  @param R_base_sensor  how the sensor stands
  /// @returns what it says of that along its own axes, the weight that hangs on it included; range and resolution are theirs
  Vec3 read(const Vec3& true_force_n, const Mat3& R_base_sensor, double time_s, Random& noise) const;
  /// The same of a torque about the sensor's origin, which the force goes with.
  Vec3 read_torque(const Vec3& true_torque_nm, const Vec3& true_force_n, const Mat3& R_base_sensor, double time_s, Random& noise) const;
  double scale() const { return scale_; }

 private:
  ForceSensorOptions options_;
  Vec3 bias_n_, drift_n_s_, torque_bias_nm_, torque_drift_nm_s_;
  double scale_ = 1;
  Mat3 gain_ = Mat3::Identity(), torque_gain_ = Mat3::Identity();
  Mat3 torque_of_force_m_ = Mat3::Zero();
};

}  // namespace palpate::lab
