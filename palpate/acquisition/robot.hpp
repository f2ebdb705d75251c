// SPDX-License-Identifier: Apache-2.0
// What the push protocol needs of a robot. A driver implements these six calls, and the others where it can; the lab's software arm
// is one of them.
#pragma once

#include <functional>
#include <limits>
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

/// What the robot itself bears, whatever a push asks for. Infinite: no limit of its own, or one that it keeps by refusing motions.
struct RobotLimits {
  static constexpr double none = std::numeric_limits<double>::infinity();
  double force_n = none;    ///< of the tip along a push: what hand and sensor bear, or what the sensor can tell
  double travel_m = none;   ///< into the object, from first contact
  double speed_m_s = none;  ///< of the tip
};

/// @throws Error naming the limit that is not positive.
void check(const RobotLimits& limits);

enum class Motion {
  done,     ///< the tip is there
  refused,  ///< a joint limit, a collision or no solution; the tip did not move
};

class Robot {
 public:
  virtual ~Robot() = default;
  virtual RobotState read() = 0;
  /// Moves the tip on a straight line; returns when it stands. Where only the way is asked for, the tip keeps its whole orientation,
  /// also about its own axis: what a wrist sensor errs by turns with it (PushReport::turned_rad). Long ways come in short motions: between them the user may stop it.
  virtual Motion move(const Pose& T_base_tip, double speed_m_s) = 0;
  /// Brings the arm to rest where it is.
  virtual void stop() = 0;
  /// With camera, pose of the camera, noise model and, where the robot is in view, its mask.
  virtual DepthFrame take_depth_image() = 0;
  /// Lets time pass. A lab's clock is not the wall's.
  virtual void wait(double duration_s) = 0;
  /// Standard deviation of the encoders' tip position along a push.
  virtual double travel_sigma_m() const = 0;
  /// Asked before every push, which then ends at the lower of these and its own. A robot that wraps another hands them on.
  virtual RobotLimits limits() const { return {}; }
  /// True: until the next false nothing is recorded of what it does and reads, the tip is on its way between pushes. It need not care;
  /// a lab keeps the noise of what is recorded apart. A robot that wraps another hands it on.
  virtual void on_the_way([[maybe_unused]] bool is) {}
  /// Carries its camera to the `view`-th, from 0, of `views` places of its own choosing around the untouched object and looks from
  /// there; the arm does not hide the object, or the image's mask says where. Nothing, and no motion: its camera is not carried.
  virtual std::optional<DepthFrame> look([[maybe_unused]] int view, [[maybe_unused]] int views) { return std::nullopt; }
};

/// One image from each of so many places around the untouched object.
/// @param views  at least 1
/// @param keep_going  asked before each of them; false stops the robot, and there are fewer images then
/// @returns nothing where the robot does not carry its camera  @throws Error for less than one view, and whatever the robot
///          throws: it is stopped then.
std::optional<std::vector<DepthFrame>> look_around(Robot& robot, int views, const std::function<bool()>& keep_going = {});

}  // namespace palpate::acquisition
