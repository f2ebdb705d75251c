// SPDX-License-Identifier: Apache-2.0
// Long motions in short pieces, with a look at the force and at the user's wish between each two. Inner header of the room.
#pragma once

#include <functional>
#include <vector>

#include "palpate/acquisition/stopped.hpp"

namespace palpate::acquisition {

/// Out of an object that the tip presses.
struct Leaving {
  double within_m = 0;      ///< from the beginning of a motion
  /// For certain, so that all that is felt there is that object, and nothing drives the tip back into it. False: what falls along the motion.
  bool is_pressed = false;
};

class GuardedMotion {
 public:
  /// @param ask_user  throws where the user wants to stop
  GuardedMotion(Robot& robot, const PushOptions& options, std::function<void()> ask_user);

  /// Straight there. What is felt on the way is a change since it set out.
  /// @returns false where the robot refused a piece: it stands at the end of the one before
  /// @throws Stopped when something is hit, after going back the way it came until nothing is felt, or the user stops it
  bool go(const Pose& to, const Leaving& leaving = {});
  const Pose& here() const { return here_; }

 private:
  void listen();
  double turned_rad(const RobotState& state) const;
  bool is_felt(const RobotState& state) const;
  void watch(const Leaving& leaving, double gone_m);
  [[noreturn]] void hit(const Vec3& change_n, const Leaving& leaving);

  Robot& robot_;
  const PushOptions& options_;
  std::function<void()> ask_user_;
  Pose here_;
  std::vector<Pose> trail_;  // where this motion has been
  Vec3 from_m_ = Vec3::Zero();  // where it set out
  Vec3 motion_ = Vec3::Zero();  // along it
  Vec3 before_n_ = Vec3::Zero();
  Mat3 R_before_ = Mat3::Identity();  // of the tip then
  double std_n_ = 0;
};

/// While one lives, the robot is on the way between pushes.
class OnTheWay {
 public:
  explicit OnTheWay(Robot& robot) : robot_(robot) { robot_.on_the_way(true); }
  ~OnTheWay() { robot_.on_the_way(false); }
  OnTheWay(const OnTheWay&) = delete;
  OnTheWay& operator=(const OnTheWay&) = delete;

 private:
  Robot& robot_;
};

}  // namespace palpate::acquisition
