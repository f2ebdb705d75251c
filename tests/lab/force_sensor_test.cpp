// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/force_sensor.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"

namespace palpate::lab::force_sensor_test {
namespace {

TEST(ForceSensor, ReadingsShowTheFiguresOfEveryRow) {
  for (const ForceSensorModel& row : force_sensors()) {
    const ForceSensorOptions& o = row.options;
    EXPECT_NO_THROW(check(o)) << row.name;
    EXPECT_FALSE(row.source.empty());
    Random once(7), noise(8);
    const ForceSensor sensor(o, once);
    Vec3 mean = Vec3::Zero(), square = Vec3::Zero();
    constexpr int count = 20000;
    for (int i = 0; i < count; ++i) {
      const Vec3 f = sensor.read(Vec3(1, 2, -10), Mat3::Identity(), 0, noise);
      mean += f / count;
      square += f.cwiseAbs2() / count;
      for (int k = 0; k < 3; ++k) ASSERT_NEAR(f(k) / o.unit_n, std::round(f(k) / o.unit_n), 1e-6);
    }
    // Quantisation adds a twelfth of its square.
    const double expected = std::sqrt(o.sigma_n * o.sigma_n + o.unit_n * o.unit_n / 12);
    EXPECT_NEAR(std::sqrt((square - mean.cwiseAbs2()).mean()) / expected, 1, 0.02) << row.name;
    EXPECT_EQ(sensor.read(Vec3(0, 0, 1e4), Mat3::Identity(), 0, noise).z(), o.range_along_n);
    EXPECT_EQ(sensor.read(Vec3(1e4, 0, 0), Mat3::Identity(), 0, noise).x(), o.range_n);
    EXPECT_EQ(sensor.read_torque(Vec3(0, -1e3, 0), Vec3::Zero(), Mat3::Identity(), 0, noise).y(), -o.torque_range_nm);
  }
  EXPECT_THROW(force_sensor("scales"), Error);
}

// Over many sensors out of the box: bias, drift, scale and cross-talk have the spread that the row states.
TEST(ForceSensor, EveryBoxHoldsAnother) {
  ForceSensorOptions o = force_sensor("schunk_ftcl_050");
  o.sigma_n = o.unit_n = o.tool_mass_kg = 0;
  constexpr int boxes = 4000;
  double bias = 0, drift = 0, scale = 0, cross = 0;
  for (std::uint64_t seed = 0; seed < boxes; ++seed) {
    Random once(seed), noise(1);
    const ForceSensor sensor(o, once);
    const Vec3 zero = sensor.read(Vec3::Zero(), Mat3::Identity(), 0, noise), later = sensor.read(Vec3::Zero(), Mat3::Identity(), 1000, noise),
               pushed = sensor.read(Vec3(0, 0, -100), Mat3::Identity(), 0, noise);
    bias += zero.squaredNorm() / 3 / boxes;
    drift += ((later - zero) / 1000).squaredNorm() / 3 / boxes;
    scale += std::pow((pushed - zero).z() / -100 - 1, 2) / boxes;
    cross += ((pushed - zero).head<2>() / 100).squaredNorm() / 2 / boxes;
  }
  EXPECT_NEAR(std::sqrt(bias) / o.bias_n, 1, 0.05);
  EXPECT_NEAR(std::sqrt(drift) / o.drift_n_s, 1, 0.05);
  EXPECT_NEAR(std::sqrt(scale) / o.scale_std, 1, 0.05);
  EXPECT_NEAR(std::sqrt(cross) / o.cross_talk_std, 1, 0.05);
}

// The torque's own: a drift, torques in each other, and forces in torques as a share of what either can be.
TEST(ForceSensor, TorquesDriftAndHearTheForces) {
  ForceSensorOptions o = force_sensor("schunk_ftcl_050");
  o.scale_std = o.torque_sigma_nm = o.torque_unit_nm = o.tool_mass_kg = 0;
  constexpr int boxes = 4000;
  double drift = 0, of_torque = 0, of_force = 0;
  for (std::uint64_t seed = 0; seed < boxes; ++seed) {
    Random once(seed), noise(1);
    const ForceSensor sensor(o, once, Random(seed, 6));
    const auto read = [&](const Vec3& torque_nm, const Vec3& force_n, double time_s) {
      return sensor.read_torque(torque_nm, force_n, Mat3::Identity(), time_s, noise);
    };
    const Vec3 none = Vec3::Zero(), zero = read(none, none, 0);
    drift += ((read(none, none, 1000) - zero) / 1000).squaredNorm() / 3 / boxes;
    const Vec3 twisted = read(Vec3(0, 0, 2), none, 0) - zero;
    EXPECT_NEAR(twisted.z(), 2, 1e-12);
    of_torque += (twisted.head<2>() / 2).squaredNorm() / 2 / boxes;
    of_force += (read(none, Vec3(0, 0, -100), 0) - zero).squaredNorm() / 3 / boxes;
  }
  EXPECT_NEAR(std::sqrt(drift) / 7e-6, 1, 0.05);
  EXPECT_NEAR(std::sqrt(of_torque) / 0.01, 1, 0.05);
  EXPECT_NEAR(std::sqrt(of_force) / 0.0233, 1, 0.05) << "a hundredth of 7 N m, at a third of 300 N";
}

// What is drawn for torques is drawn apart, so that recordings of forces stay what they were.
TEST(ForceSensor, WhatIsDrawnForTorquesLeavesTheForcesAlone) {
  Random once(3), noise(4), again(3), same(4);
  const ForceSensor with(force_sensor("schunk_ftcl_050"), once, Random(3, 6)), without(force_sensor("schunk_ftcl_050"), again, Random(99));
  const Vec3 push_n(1, 2, -10);
  EXPECT_EQ(with.read(push_n, Mat3::Identity(), 7, noise), without.read(push_n, Mat3::Identity(), 7, same));
}

// Whoever changes a number finds its source in the way.
TEST(ForceSensor, EveryNumberStandsInTheTableOfSources) {
  const std::string text = io::read_file(PALPATE_SOURCE_DIR "/docs/lab.md");
  for (const ForceSensorModel& row : force_sensors()) {
    const std::size_t begin = text.find("| `" + std::string(row.name) + "` | ");
    ASSERT_NE(begin, std::string::npos) << row.name;
    const std::string line = text.substr(begin, text.find('\n', begin) - begin);
    const ForceSensorOptions& o = row.options;
    for (const std::string& figure :
         {fmt::format("{:g} mN, {:g} mN m", 1e3 * o.sigma_n, 1e3 * o.torque_sigma_nm),
          fmt::format("{:g} mN, {:g} mN m", 1e3 * o.unit_n, 1e3 * o.torque_unit_nm),
          fmt::format("{:g} N, {:g} N, {:g} N m", o.range_n, o.range_along_n, o.torque_range_nm),
          fmt::format("{:g} N, {:g} mN m", o.bias_n, 1e3 * o.torque_bias_nm),
          fmt::format("{:g} N, {:.2g} mN m", 3600 * o.drift_n_s, 3.6e6 * o.torque_drift_nm_s),
          fmt::format("{:g} %", 100 * o.scale_std), fmt::format("{:g} %", 100 * o.cross_talk_std)})
      EXPECT_NE(line.find("| " + figure), std::string::npos) << row.name << ": " << figure << " in " << line;
  }
}

// What errs belongs to the sensor and turns with the wrist; the weight that hangs on it does not.
TEST(ForceSensor, ErrorsTurnWithTheWrist) {
  ForceSensorOptions o = force_sensor("schunk_ftcl_050");
  o.sigma_n = o.unit_n = o.drift_n_s = 0;
  Random once(5), noise(1);
  const ForceSensor sensor(o, once);
  const Mat3 turned = Eigen::AngleAxisd(2.1, Vec3(0.3, -0.8, 0.5).normalized()).toRotationMatrix();
  const auto base_force = [&](const Mat3& R, const Vec3& push_n) { return Vec3(R * sensor.read(push_n, R, 0, noise)); };
  // Along the sensor's own axes the same push reads the same, whatever way it stands.
  const Vec3 push_n(1, -4, 20), weight_n(0, 0, 9.81 * o.tool_mass_kg);
  const Vec3 upright = sensor.read(push_n - weight_n, Mat3::Identity(), 0, noise),
             aside = sensor.read(turned * push_n - weight_n, turned, 0, noise);
  EXPECT_NEAR((upright - aside).norm(), 0, 1e-12);
  // Without bias, scale and cross-talk the base frame sees push and weight alone.
  o.bias_n = o.scale_std = o.cross_talk_std = 0;
  const ForceSensor perfect(o, once);
  for (const Mat3& R : {Mat3(Mat3::Identity()), turned})
    EXPECT_NEAR((R * perfect.read(push_n, R, 0, noise) - push_n - weight_n).norm(), 0, 1e-12);
  // The weight hangs 0.15 m along the hand: its torque is what levers say, and a push's is what it is.
  o.torque_sigma_nm = o.torque_unit_nm = o.torque_bias_nm = o.torque_drift_nm_s = 0;
  const ForceSensor exact(o, once);
  const Vec3 torque_nm(0.3, -0.2, 0.1), lever_m = turned * Vec3(0, 0, o.tool_centre_m);
  EXPECT_NEAR((turned * exact.read_torque(torque_nm, push_n, turned, 50, noise) - torque_nm - lever_m.cross(weight_n)).norm(), 0, 1e-12);
  EXPECT_GT((base_force(turned, push_n) - base_force(Mat3::Identity(), push_n)).norm(), 0.1) << "its bias has turned";
}

}  // namespace
}  // namespace palpate::lab::force_sensor_test
