// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/wrench.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "palpate/core/error.hpp"

namespace palpate::sensing::wrench_test {
namespace {

const Vec3 gravity(0, 0, -9.81);

ToolWeight hand() {
  ToolWeight tool;
  tool.mass_kg = 0.42;
  tool.centre_m = {0.01, -0.005, 0.06};
  tool.force_bias_n = {1.2, -0.7, 3.1};
  tool.torque_bias_nm = {0.02, 0.05, -0.04};
  return tool;
}

// What the sensor reads when the object pushes the tool's tip with `force_on_tool` (base axes).
WrenchReading read(const ToolWeight& tool, const Mat3& R_base_sensor, const Vec3& tip_m, const Vec3& force_on_tool) {
  WrenchReading reading;
  reading.R_base_sensor = R_base_sensor;
  const Vec3 weight = tool.mass_kg * (R_base_sensor.transpose() * gravity), push = R_base_sensor.transpose() * force_on_tool;
  reading.force_n = tool.force_bias_n + weight + push;
  reading.torque_nm = tool.torque_bias_nm + tool.centre_m.cross(weight) + tip_m.cross(push);
  return reading;
}

std::vector<Mat3> orientations() {
  std::vector<Mat3> all;
  for (const double a : {0.0, 0.8, 1.6})
    for (const double b : {-0.7, 0.5})
      all.push_back((Eigen::AngleAxisd(a, Vec3::UnitX()) * Eigen::AngleAxisd(b, Vec3::UnitY())).toRotationMatrix());
  return all;
}

TEST(Wrench, WeightAndBiasAreFoundExactlyWithoutNoise) {
  std::vector<WrenchReading> readings;
  for (const Mat3& R : orientations()) readings.push_back(read(hand(), R, Vec3::Zero(), Vec3::Zero()));
  const ToolWeight found = calibrate_tool(readings, gravity);
  EXPECT_NEAR(found.mass_kg, 0.42, 1e-12);
  EXPECT_NEAR((found.centre_m - hand().centre_m).norm(), 0, 1e-12);
  EXPECT_NEAR((found.force_bias_n - hand().force_bias_n).norm(), 0, 1e-12);
  EXPECT_NEAR((found.torque_bias_nm - hand().torque_bias_nm).norm(), 0, 1e-12);
}

TEST(Wrench, StatedDeviationsAgreeWithMonteCarlo) {
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) {
    return Vec3(sigma * Vec3(normal(generator), normal(generator), normal(generator)));
  };
  double mass_square = 0, mass_stated = 0, bias_square = 0, bias_stated = 0, centre_square = 0, centre_stated = 0;
  constexpr int trials = 400;
  for (int t = 0; t < trials; ++t) {
    std::vector<WrenchReading> readings;
    for (const Mat3& R : orientations()) {
      readings.push_back(read(hand(), R, Vec3::Zero(), Vec3::Zero()));
      readings.back().force_n += noise(0.1);
      readings.back().torque_nm += noise(0.003);
    }
    const ToolWeight found = calibrate_tool(readings, gravity);
    mass_square += std::pow(found.mass_kg - 0.42, 2);
    mass_stated += std::pow(found.mass_std_kg, 2);
    bias_square += (found.force_bias_n - hand().force_bias_n).squaredNorm();
    bias_stated += found.force_bias_std_n.squaredNorm();
    centre_square += (found.centre_m - hand().centre_m).squaredNorm();
    centre_stated += found.centre_std_m.squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(mass_square / mass_stated), 1, 0.12);
  EXPECT_NEAR(std::sqrt(bias_square / bias_stated), 1, 0.12);
  EXPECT_NEAR(std::sqrt(centre_square / centre_stated), 1, 0.2);
}

TEST(Wrench, ToolOnObjectAtTheTipWhateverTheOrientation) {
  const Vec3 tip(0.0, 0.01, 0.35), on_tool(0.5, -0.2, 7.5);
  for (const Mat3& R : orientations()) {
    const Wrench wrench = wrench_at_tip(read(hand(), R, tip, on_tool), hand(), gravity, tip);
    EXPECT_NEAR((wrench.force_n + on_tool).norm(), 0, 1e-12) << "opposite of what the object does to the tool";
    EXPECT_NEAR(wrench.torque_nm.norm(), 0, 1e-12) << "a force through the tip has no moment there";
    EXPECT_TRUE(wrench.has_torque);
  }
  EXPECT_TRUE(torque_about(Vec3(0, 0, 1), Vec3(0, 2, 0), Vec3(3, 0, 0), Vec3::Zero()).isApprox(Vec3(0, 0, 7)));
}

TEST(Wrench, TareKeepsTheWeightAndRenewsTheBias) {
  ToolWeight drifted = hand();
  drifted.force_bias_n += Vec3(0.3, 0.1, -0.5);
  drifted.torque_bias_nm += Vec3(0.01, 0, 0);
  const std::vector<WrenchReading> readings(4, read(drifted, orientations()[3], Vec3::Zero(), Vec3::Zero()));
  const ToolWeight found = tare(hand(), readings, gravity);
  EXPECT_NEAR((found.force_bias_n - drifted.force_bias_n).norm(), 0, 1e-12);
  EXPECT_NEAR((found.torque_bias_nm - drifted.torque_bias_nm).norm(), 0, 1e-12);
  EXPECT_EQ(found.mass_kg, 0.42);
  EXPECT_THROW(tare(hand(), {}, gravity), Error);
}

TEST(Wrench, OrientationsTooAlikeAreRefusedWithTheCure) {
  std::vector<WrenchReading> readings(5, read(hand(), Mat3::Identity(), Vec3::Zero(), Vec3::Zero()));
  try {
    calibrate_tool(readings, gravity);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("tilt"));
  }
  // Turning about one axis only: gravity's direction moves in a plane, which is enough.
  readings.clear();
  for (const double a : {0.0, 0.7, 1.4})
    readings.push_back(read(hand(), Eigen::AngleAxisd(a, Vec3::UnitX()).toRotationMatrix(), Vec3::Zero(), Vec3::Zero()));
  EXPECT_NO_THROW(calibrate_tool(readings, gravity));
  EXPECT_THROW(calibrate_tool(readings, Vec3::Zero()), Error);
  readings.resize(2);
  EXPECT_THROW(calibrate_tool(readings, gravity), Error);
}

}  // namespace
}  // namespace palpate::sensing::wrench_test
