// SPDX-License-Identifier: Apache-2.0
// Iterative closest point of a cloud against a surface, started from what the robot knows.
#pragma once

#include <optional>
#include <string>

#include "palpate/core/recording.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::registration {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

enum class IcpMetric {
  point_to_point,  ///< Besl, McKay 1992: slides slowly along flat parts
  point_to_plane,  ///< Chen, Medioni 1992: distance along the surface's normal, a few steps
};

struct IcpOptions {
  IcpMetric metric = IcpMetric::point_to_plane;
  double reject_m = 0.03;         ///< pairs farther apart do not count (> 0)
  double trim = 1.0;              ///< share of the nearest pairs that counts (0.1..1)
  double tukey = 0;               ///< beyond this many robust deviations a pair counts nothing (0 = off, else >= 2)
  double reject_angle_rad = 1.2;  ///< between the cloud's normal (where known) and the surface's
  int max_iterations = 50;        ///< >= 1
  /// Where the points were seen from, in the cloud's frame. Noise along the rays that exceeds the surface's own roughness
  /// biases closest points; with it the last steps pair every point with what its ray meets, and sigma is along the ray.
  std::optional<Vec3> sensor_m;
  double stop_share = 0.05;  ///< converged when a step is below this share of the answer's own standard deviation
};

/// @throws Error naming the field and its bounds.
void check(const IcpOptions& options);

struct IcpResult {
  Pose T_surface_cloud = Pose::Identity();
  /// Of (rotation vector, translation) applied on the left in the surface's frame, T_true = exp(d) T: rad2, rad m, m2. Open
  /// directions keep the start and carry no variance here.
  Matrix6 covariance = Matrix6::Zero();
  int open_directions = 0;  ///< along which the surface may slide over the points (plane 3, sphere 3, cylinder 2)
  double rms_m = 0;         ///< of the pairs that count, in the metric
  double sigma_m = 0;       ///< standard deviation of a pair that the covariance was scaled with
  Index pairs = 0;          ///< that counted
  int iterations = 0;
  bool converged = false;
  std::string reason = "align() was not called.";
};

/// Points are weighted by 1 / sigma_m^2 where the cloud gives it; the covariance is then scaled by the misfit only if that
/// is larger than one, and by the misfit alone where the cloud is silent. @throws Error on bad options or fewer than six
/// points.
IcpResult align(const PointCloud& cloud, const geometry::TriangleTree& surface, const Pose& T_surface_cloud,
                const IcpOptions& options = {});

}  // namespace palpate::registration
