// SPDX-License-Identifier: Apache-2.0
// What the push protocol needs of a robot. A driver implements these six calls; the lab's software arm is one of them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::acquisition {

/// Read at one time.
struct RobotState {
  double time_s = 0;
  std::vector<double> joints_rad;
  Pose T_base_tip = Pose::Identity();  ///< z along the tool, into the object
  Vec3 force_n = Vec3::Zero();         ///< of the tool on the object, base frame; a constant bias is allowed
  /// Of the tool on the object about the tip, base frame; a constant bias is allowed. It says where a force acts. Nothing: not measured.
  std::optional<Vec3> torque_nm;
};

enum class Motion {
  done,     ///< the tip is there
  refused,  ///< a joint limit, a collision or no solution; the tip did not move
};

class Robot {
 public:
  virtual ~Robot() = default;
  virtual RobotState read() = 0;
  /// Moves the tip on a straight line; returns when it stands.
  virtual Motion move(const Pose& T_base_tip, double speed_m_s) = 0;
  /// Brings the arm to rest where it is.
  virtual void stop() = 0;
  /// With camera, pose of the camera, noise model and, where the robot is in view, its mask.
  virtual DepthFrame take_depth_image() = 0;
  /// Lets time pass. A lab's clock is not the wall's.
  virtual void wait(double duration_s) = 0;
  /// Standard deviation of the encoders' tip position along a push.
  virtual double travel_sigma_m() const = 0;
};

}  // namespace palpate::acquisition
