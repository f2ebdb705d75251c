// SPDX-License-Identifier: Apache-2.0
// Many views of one object at once: every pair that overlaps pulls, so that the last view closes up with the first.
#pragma once

#include <string>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::registration {

struct ViewsOptions {
  double cell_m = 0;              ///< width over which points are averaged before they are compared; 0 = from noise and size
  double reject_m = 0;            ///< pairs farther apart do not count at the start; 0 = from the poses' priors, or the size
  double reject_angle_rad = 0.8;  ///< between the normals of a pair
  int max_iterations = 40;        ///< >= 1
};

/// @throws Error naming the field and its bounds.
void check(const ViewsOptions& options);

struct ViewsResult {
  std::vector<Pose> correction;  ///< of each view, applied on the left: p_true = correction * p
  /// Of (rotation vector about the view's centre, translation) of each view in turn: rad2, rad m, m2; 6 K x 6 K. Without
  /// priors the first view is held, and its rows are zero.
  MatrixX covariance;
  std::vector<Vec3> centre_m;  ///< the views' centres, about which the covariance's rotations turn
  double rms_m = 0;            ///< of the pairs' distances along their normals
  Index pairs = 0;
  std::vector<Index> alone;  ///< views that overlap with no other one
  int iterations = 0;
  bool converged = false;
  std::string reason = "align_views() was not called.";
};

/// @param clouds  in one frame, as the robot knows it, each with unit normals; pose_std_m and pose_std_rad are the priors
///                (where all are zero, the first view is held and the others are free)
/// Points are averaged over cells to small discs; a disc is paired with the nearest one of every other view, and distances
/// along the mean of both normals are minimised (symmetric point to plane, Rusinkiewicz 2019, which does not feel curvature
/// of second order) over all poses together.
/// @throws Error when there are fewer than two clouds, or one has no normals.
ViewsResult align_views(const std::vector<PointCloud>& clouds, const ViewsOptions& options = {});

}  // namespace palpate::registration
