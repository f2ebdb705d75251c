// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/force_sensor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate::lab {
namespace {

constexpr double gravity_m_s2 = 9.81;

Vec3 as_read(Vec3 value, double unit, const Vec3& range) {
  for (int k = 0; k < 3; ++k) {
    if (unit > 0) value(k) = unit * std::round(value(k) / unit);
    value(k) = std::clamp(value(k), -range(k), range(k));
  }
  return value;
}

// Every number with its source, or that it has none: docs/lab.md, "Where the numbers come from". Ranges and resolutions are the
// makers' where a source is named; no sheet that could be had states noise, drift or cross-talk.
constexpr std::array<ForceSensorModel, 4> sensor_table{{
    {"generic", "a good strain-gauge sensor without cross-talk", {}},
    {"schunk_ftcl_050", "range 300 N: Frank et al. 2010, section V; the rest has no source: assumed",
     {.sigma_n = 0.08, .unit_n = 0.05, .range_n = 300, .range_along_n = 300, .bias_n = 1.0, .drift_n_s = 0.0003, .scale_std = 0.015,
      .cross_talk_std = 0.01, .torque_sigma_nm = 0.004, .torque_unit_nm = 0.001, .torque_range_nm = 7, .torque_drift_nm_s = 7e-6}},
    {"ati_gamma", "ATI Gamma SI-32-2.5: ranges 32 N across, 100 N along and 2.5 N m, resolutions 6.25 mN and 0.5 mN m (manual 9620-05); "
                  "the rest has no source: assumed",
     {.sigma_n = 0.01, .unit_n = 0.00625, .range_n = 32, .range_along_n = 100, .bias_n = 0.5, .drift_n_s = 0.0001, .scale_std = 0.01,
      .cross_talk_std = 0.005, .torque_sigma_nm = 0.0005, .torque_unit_nm = 0.0005, .torque_range_nm = 2.5,
      .torque_drift_nm_s = 2.5e-6}},
    {"ideal", "none such: for tests of the rest",
     {.sigma_n = 0.001, .unit_n = 0.0001, .range_n = 1000, .range_along_n = 1000, .bias_n = 1.0, .drift_n_s = 0, .scale_std = 0.01,
      .torque_sigma_nm = 1e-5, .torque_unit_nm = 0, .torque_range_nm = 100, .torque_drift_nm_s = 0}},
}};

}  // namespace

std::span<const ForceSensorModel> force_sensors() { return sensor_table; }

ForceSensorOptions force_sensor(std::string_view name) {
  std::string names;
  for (const ForceSensorModel& row : sensor_table) {
    if (row.name == name) return row.options;
    names += (names.empty() ? "" : ", ") + std::string(row.name);
  }
  throw Error("is no force sensor of the lab; there are: " + names, "force sensor " + std::string(name));
}

void check(const ForceSensorOptions& o) {
  const auto need = [](bool good, const char* field, const char* rule) {
    if (!good) throw Error(rule, std::string("ForceSensorOptions.") + field);
  };
  need(o.sigma_n >= 0, "sigma_n", "must not be negative");
  need(o.unit_n >= 0, "unit_n", "must not be negative");
  need(o.range_n > 0, "range_n", "must be positive");
  need(o.bias_n >= 0, "bias_n", "must not be negative");
  need(o.drift_n_s >= 0, "drift_n_s", "must not be negative");
  need(o.scale_std >= 0 && o.scale_std < 0.3, "scale_std", "must be in [0, 0.3)");
  need(o.cross_talk_std >= 0 && o.cross_talk_std < 0.3, "cross_talk_std", "must be in [0, 0.3)");
  need(o.range_along_n > 0, "range_along_n", "must be positive");
  need(o.torque_sigma_nm >= 0, "torque_sigma_nm", "must not be negative");
  need(o.torque_unit_nm >= 0, "torque_unit_nm", "must not be negative");
  need(o.torque_range_nm > 0, "torque_range_nm", "must be positive");
  need(o.torque_bias_nm >= 0, "torque_bias_nm", "must not be negative");
  need(o.torque_drift_nm_s >= 0, "torque_drift_nm_s", "must not be negative");
  need(o.tool_mass_kg >= 0, "tool_mass_kg", "must not be negative");
}

double readable_along_n(const ForceSensorOptions& o) {
  const double borne_n = gravity_m_s2 * o.tool_mass_kg + 3 * o.bias_n;
  return std::max(0.1 * o.range_along_n, o.range_along_n - borne_n);
}

ForceSensor::ForceSensor(const ForceSensorOptions& options, Random& once, Random of_torque) : options_(options) {
  check(options);
  bias_n_ = options.bias_n * once.normal3();
  drift_n_s_ = options.drift_n_s * once.normal3();
  torque_bias_nm_ = options.torque_bias_nm * of_torque.normal3();
  scale_ = 1 + options.scale_std * once.normal();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (i != j) gain_(i, j) = options.cross_talk_std * once.normal();
  torque_drift_nm_s_ = options.torque_drift_nm_s * of_torque.normal3();
  const double of_force_m = options.cross_talk_std * options.torque_range_nm / options.range_along_n;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      if (i != j) torque_gain_(i, j) = options.cross_talk_std * of_torque.normal();
      torque_of_force_m_(i, j) = of_force_m * of_torque.normal();
    }
}

Vec3 ForceSensor::read(const Vec3& true_force_n, const Mat3& R_base_sensor, double time_s, Random& noise) const {
  // A reaction on the tool is the force on the object with the other sign; drivers turn it round, and so the weight too.
  const Vec3 weight_n(0, 0, gravity_m_s2 * options_.tool_mass_kg);
  const Vec3 along_axes = R_base_sensor.transpose() * (true_force_n + weight_n);
  const Vec3 force = scale_ * (gain_ * along_axes) + bias_n_ + drift_n_s_ * time_s + options_.sigma_n * noise.normal3();
  const double across_n = options_.range_n;
  return as_read(force, options_.unit_n, Vec3(across_n, across_n, options_.range_along_n));
}

Vec3 ForceSensor::read_torque(const Vec3& true_torque_nm, const Vec3& true_force_n, const Mat3& R_base_sensor, double time_s,
                              Random& noise) const {
  const Vec3 weight_n(0, 0, gravity_m_s2 * options_.tool_mass_kg), centre_m(0, 0, options_.tool_centre_m);
  const Vec3 along_axes = R_base_sensor.transpose() * true_torque_nm + centre_m.cross(Vec3(R_base_sensor.transpose() * weight_n));
  const Vec3 of_force_nm = torque_of_force_m_ * (R_base_sensor.transpose() * (true_force_n + weight_n));
  const Vec3 torque = scale_ * (torque_gain_ * along_axes + of_force_nm) + torque_bias_nm_ + torque_drift_nm_s_ * time_s +
                      options_.torque_sigma_nm * noise.normal3();
  return as_read(torque, options_.torque_unit_nm, Vec3::Constant(options_.torque_range_nm));
}

}  // namespace palpate::lab
