// SPDX-License-Identifier: Apache-2.0
// Takes the arm and its tool out of what the sensors of a recording saw.
#pragma once

#include <optional>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/sensing/robot_mask.hpp"
#include "palpate/sensing/stick_mask.hpp"

namespace palpate::sensing {

/// The tool of a step where the robot says that its tip is (`T_base_tip`), also before it touches. None where that is not
/// known, or where the push has no tool or one that is neither a ball nor a disc.
std::vector<Stick> sticks_of(const Recording& recording, const Push& push, const Step& step);

class ArmMask {
 public:
  /// @param recording  must outlive this
  /// @throws Error as RobotMask does
  explicit ArmMask(const Recording& recording);

  /// Pixels that show the robot by its description and the step's joints; where nobody has masked anything and no shape of a
  /// robot or no joints are known, those of the stick. An image that says robot_is_masked stays as it is.
  DepthFrame without_arm(const DepthFrame& frame, const Push& push, const Step& step) const;

  /// Of a cloud the stick: the robot was left out by who recorded it.
  PointCloud without_arm(const PointCloud& cloud, const Push& push, const Step& step) const;

 private:
  const Recording& recording_;
  std::optional<RobotMask> robot_;  // of one that was recorded without shapes nothing can be masked
};

}  // namespace palpate::sensing
