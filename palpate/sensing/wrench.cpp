// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/wrench.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>

#include "palpate/core/cross_matrix.hpp"
#include "palpate/core/error.hpp"

namespace palpate::sensing {

Vec3 torque_about(const Vec3& torque_nm, const Vec3& force_n, const Vec3& from_m, const Vec3& to_m) {
  return torque_nm + (from_m - to_m).cross(force_n);
}

// f = b + m g_s and t = b_t + m c x g_s are linear in (m, b) and (m c, b_t), with g_s gravity in the sensor's frame.
ToolWeight calibrate_tool(const std::vector<WrenchReading>& readings, const Vec3& gravity_m_s2) {
  if (!(gravity_m_s2.norm() > 0.1)) throw Error("is zero: without gravity a tool has no weight to find", "gravity_m_s2");
  if (readings.size() < 3)
    throw Error("has " + std::to_string(readings.size()) + " readings; record at least three orientations", "free_air");
  const auto count = Eigen::Index(readings.size());
  MatrixX force_rows(3 * count, 4), torque_rows(3 * count, 6);
  VectorX force(3 * count), torque(3 * count);
  Vec3 mean = Vec3::Zero();
  for (Eigen::Index i = 0; i < count; ++i) {
    const WrenchReading& r = readings[std::size_t(i)];
    const Vec3 g = r.R_base_sensor.transpose() * gravity_m_s2;
    mean += g / double(count);
    force_rows.middleRows<3>(3 * i) << g, Mat3::Identity();
    torque_rows.middleRows<3>(3 * i) << -cross_matrix(g), Mat3::Identity();
    force.segment<3>(3 * i) = r.force_n;
    torque.segment<3>(3 * i) = r.torque_nm;
  }
  Mat3 spread = Mat3::Zero();
  for (const WrenchReading& r : readings) {
    const Vec3 d = r.R_base_sensor.transpose() * gravity_m_s2 - mean;
    spread += d * d.transpose() / double(count);
  }
  // The centre of mass needs gravity from two directions that differ: the second largest spread tells.
  const Vec3 spreads = Eigen::SelfAdjointEigenSolver<Mat3>(spread).eigenvalues();
  if (std::sqrt(std::max(spreads(1), 0.0)) < 0.05 * gravity_m_s2.norm())
    throw Error("has orientations that are too alike: tilt the hand by 30 degrees or more about two axes", "free_air");

  const MatrixX force_inverse = (force_rows.transpose() * force_rows).inverse();
  const MatrixX torque_inverse = (torque_rows.transpose() * torque_rows).inverse();
  const VectorX a = force_inverse * (force_rows.transpose() * force);
  const VectorX b = torque_inverse * (torque_rows.transpose() * torque);
  ToolWeight tool;
  tool.mass_kg = a(0);
  tool.force_bias_n = a.tail<3>();
  tool.torque_bias_nm = b.tail<3>();
  const double force_chi2 = (force - force_rows * a).squaredNorm(), torque_chi2 = (torque - torque_rows * b).squaredNorm();
  tool.force_rms_n = std::sqrt(force_chi2 / double(3 * count));
  tool.torque_rms_nm = std::sqrt(torque_chi2 / double(3 * count));
  const double force_variance = force_chi2 / double(std::max<Eigen::Index>(1, 3 * count - 4));
  const double torque_variance = torque_chi2 / double(std::max<Eigen::Index>(1, 3 * count - 6));
  tool.mass_std_kg = std::sqrt(force_variance * force_inverse(0, 0));
  tool.force_bias_std_n = (force_variance * force_inverse.diagonal().tail<3>()).cwiseSqrt();
  if (std::abs(tool.mass_kg) > 1e-9) {
    tool.centre_m = b.head<3>() / tool.mass_kg;
    const Vec3 moment_variance = torque_variance * torque_inverse.diagonal().head<3>();
    for (int k = 0; k < 3; ++k)
      tool.centre_std_m(k) =
          std::hypot(std::sqrt(moment_variance(k)), tool.centre_m(k) * tool.mass_std_kg) / std::abs(tool.mass_kg);
  }
  return tool;
}

ToolWeight tare(ToolWeight tool, const std::vector<WrenchReading>& readings, const Vec3& gravity_m_s2) {
  if (readings.empty()) throw Error("has no reading", "free_air");
  const auto count = double(readings.size());
  Vec3 force = Vec3::Zero(), torque = Vec3::Zero(), square = Vec3::Zero();
  std::vector<Vec3> single;
  for (const WrenchReading& r : readings) {
    const Vec3 weight = tool.mass_kg * (r.R_base_sensor.transpose() * gravity_m_s2);
    single.emplace_back(r.force_n - weight);
    force += single.back() / count;
    torque += (r.torque_nm - tool.centre_m.cross(weight)) / count;
  }
  for (const Vec3& f : single) square += (f - force).cwiseAbs2() / std::max(1.0, count - 1);
  tool.force_bias_n = force;
  tool.torque_bias_nm = torque;
  tool.force_bias_std_n = (square / count).cwiseSqrt();
  return tool;
}

Wrench wrench_at_tip(const WrenchReading& reading, const ToolWeight& tool, const Vec3& gravity_m_s2,
                     const Vec3& tip_in_sensor_m) {
  const Vec3 weight = tool.mass_kg * (reading.R_base_sensor.transpose() * gravity_m_s2);
  // What is left is the force of the object on the tool; the tool's on the object is its opposite.
  const Vec3 force = -(reading.force_n - tool.force_bias_n - weight);
  const Vec3 torque = -(reading.torque_nm - tool.torque_bias_nm - tool.centre_m.cross(weight));
  Wrench wrench;
  wrench.time_s = reading.time_s;
  wrench.force_n = reading.R_base_sensor * force;
  wrench.torque_nm = reading.R_base_sensor * torque_about(torque, force, Vec3::Zero(), tip_in_sensor_m);
  wrench.has_torque = true;
  return wrench;
}

}  // namespace palpate::sensing
