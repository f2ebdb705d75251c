// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/stick_mask.hpp"

#include <algorithm>

#include "palpate/core/point_cloud.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::sensing {
namespace {

bool is_on_one(const std::vector<Stick>& sticks, const Vec3& point_m, double sigma_m) {
  const double beside_m = 0.003 + 3 * sigma_m;
  return std::any_of(sticks.begin(), sticks.end(), [&](const Stick& stick) {
    const Vec3 from_tip = point_m - stick.tip_m;
    const double behind_m = -stick.inward.dot(from_tip);
    return behind_m > -beside_m && (from_tip + behind_m * stick.inward).norm() < stick.radius_m + beside_m;
  });
}

}  // namespace

PointCloud without_sticks(const PointCloud& cloud, const std::vector<Stick>& sticks) {
  demand_sigmas(cloud);
  std::vector<Index> others;
  for (Index i = 0; i < cloud.points_m.rows(); ++i)
    if (!is_on_one(sticks, cloud.points_m.row(i), sigma_of_m(cloud, i))) others.push_back(i);
  return chosen_points(cloud, others);
}

MaskImage mask_sticks(const DepthFrame& frame, const std::vector<Stick>& sticks) {
  MaskImage mask = MaskImage::Zero(frame.depth_m.rows(), frame.depth_m.cols());
  if (sticks.empty()) return mask;
  const Points directions = pixel_directions(frame.camera);
  for (Eigen::Index row = 0; row < mask.rows(); ++row)
    for (Eigen::Index column = 0; column < mask.cols(); ++column) {
      const double z = frame.depth_m(row, column);
      if (!(z > 0)) continue;
      const Vec3 point = frame.T_base_camera * Vec3(z * directions.row(row * mask.cols() + column).transpose());
      mask(row, column) = is_on_one(sticks, point, axial_sigma_m(frame.noise, {z, 0, frame.camera.fx_px}));
    }
  return mask;
}

}  // namespace palpate::sensing
