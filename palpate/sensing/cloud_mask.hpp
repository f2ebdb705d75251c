// SPDX-License-Identifier: Apache-2.0
// Which points of a cloud show the object: clouds of a depth camera hold the table, the robot and the room as well.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/sensing/plane_mask.hpp"
#include "palpate/sensing/robot_mask.hpp"

namespace palpate::sensing {

struct CloudMaskOptions {
  PlaneMaskOptions planes;    ///< `margin_m` and `sigmas` of the points' noise; the window is `neighbours`
  int neighbours = 24;        ///< points whose median height above a plane decides; 0 = the point itself
  double most_points = 6000;  ///< beyond that every n-th is kept: neighbours err together, and more say nothing
};

/// The points of a cloud that may show the object, with their normals and standard deviations; none may be. They are within a
/// box around it and above tables and walls. As of pixels (mask_planes) the median of the neighbours decides near a plane, so
/// that a point's own noise does not choose it.
/// @param planes  their normals point to the side where the object is
/// @param low_m,high_m  corners of the box around the object, base frame
/// @throws Error when an option is negative, or sigma_m has neither one value nor one a point
PointCloud points_of_object(const PointCloud& cloud, const std::vector<Plane>& planes, const Vec3& low_m, const Vec3& high_m,
                            const CloudMaskOptions& options = {});

/// Takes the robot out of clouds. Const calls are thread-safe.
class RobotInClouds {
 public:
  /// @param robot  must outlive this
  /// @param margin_m  around its shapes, beside 3 standard deviations of a point and 2 of the cloud's and a link's place
  explicit RobotInClouds(const RobotMask& robot, double margin_m = 0.005);

  /// The points that are not on those links whose pose `joints_rad` tell; the others stay.
  /// @throws Error as RobotMask::known_links does, or when sigma_m has neither one value nor one a point
  PointCloud without_robot(const PointCloud& cloud, const std::vector<std::string>& joint_names, const std::vector<double>& joints_rad,
                           const Pose& T_base_root = Pose::Identity()) const;

 private:
  struct Link;

  const RobotMask& robot_;
  double margin_m_;
  std::vector<std::shared_ptr<const Link>> links_;
};

}  // namespace palpate::sensing
