// SPDX-License-Identifier: Apache-2.0
// Which pushes a robot's arm can make: within its joints' limits, and with no link through table or wall.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/sensing/kinematics.hpp"

namespace palpate::sensing {

/// Where the tool sits on the arm.
struct MountedTool {
  std::string link;
  Pose T_link_tip = Pose::Identity();  ///< z along the push
  double spread_m = 0;                 ///< root mean square between where the joints and where the loads say that it was
  std::vector<double> joints;          ///< of the first loaded step, one a free joint
};

/// From where loaded steps touched and the joints that they were made with: the link that the contact moved with.
/// @throws Error as Kinematics does, or when a free joint has no value in the recording
/// @returns nothing when no link explains it within 5 mm and three times better than a fixed point does
std::optional<MountedTool> find_tool(const Kinematics& kinematics, const Recording& recording);

class ArmReach {
 public:
  /// @param planes  that no moving link goes through (5 mm of tolerance)
  /// @throws Error as Kinematics does, or when there is no such link
  ArmReach(const RobotModel& robot, const MountedTool& tool, std::vector<Plane> planes);
  ~ArmReach();

  /// The arm gets its tip in front of the contact and from there straight into the object, whatever its roll.
  bool reaches(const Vec3& contact_m, const Vec3& direction, double before_m, double beyond_m) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::sensing
