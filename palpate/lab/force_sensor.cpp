// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/force_sensor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate::lab {
namespace {

// Noise, drift and cross-talk are not in the sheets that could be had: they are of the size that users of strain-gauge sensors
// report. Ranges and resolutions are the makers'.
constexpr std::array<ForceSensorModel, 4> table{{
    {"generic", "a good strain-gauge sensor without cross-talk", {}},
    {"schunk_ftcl_050", "range 300 N: Frank et al. 2010, section V; the rest of the size usual in its class",
     {0.08, 0.05, 300, 1.0, 0.0003, 0.015, 0.01, 0.3}},
    {"ati_gamma", "ATI Gamma SI-32-2.5: range 32 N across, resolution 6.25 mN (manual 9620-05); the rest of the size usual",
     {0.01, 0.00625, 32, 0.5, 0.0001, 0.01, 0.005, 0.3}},
    {"ideal", "none such: for tests of the rest", {0.001, 0.0001, 1000, 1.0, 0, 0.01, 0, 0.3}},
}};

}  // namespace

std::span<const ForceSensorModel> force_sensors() { return table; }

ForceSensorOptions force_sensor(std::string_view name) {
  std::string names;
  for (const ForceSensorModel& row : table) {
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
  need(o.tool_mass_kg >= 0, "tool_mass_kg", "must not be negative");
}

ForceSensor::ForceSensor(const ForceSensorOptions& options, Random& once) : options_(options) {
  check(options);
  bias_n_ = options.bias_n * once.normal3();
  drift_n_s_ = options.drift_n_s * once.normal3();
  scale_ = 1 + options.scale_std * once.normal();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (i != j) gain_(i, j) = options.cross_talk_std * once.normal();
}

Vec3 ForceSensor::read(const Vec3& true_force_n, const Mat3& R_base_sensor, double time_s, Random& noise) const {
  // A reaction on the tool is the force on the object with the other sign; drivers turn it round, and so the weight too.
  const Vec3 weight_n(0, 0, 9.81 * options_.tool_mass_kg);
  Vec3 force = scale_ * (gain_ * (R_base_sensor.transpose() * (true_force_n + weight_n))) + bias_n_ + drift_n_s_ * time_s + options_.sigma_n * noise.normal3();
  for (int k = 0; k < 3; ++k) {
    if (options_.unit_n > 0) force(k) = options_.unit_n * std::round(force(k) / options_.unit_n);
    force(k) = std::clamp(force(k), -options_.range_n, options_.range_n);
  }
  return force;
}

}  // namespace palpate::lab
