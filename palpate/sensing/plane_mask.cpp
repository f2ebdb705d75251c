// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/plane_mask.hpp"

#include <cmath>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::sensing {

MaskImage mask_planes(const DepthFrame& frame, const std::vector<Plane>& planes, const PlaneMaskOptions& options) {
  if (!(options.margin_m >= 0)) throw Error("must not be negative", "PlaneMaskOptions.margin_m");
  if (!(options.sigmas >= 0)) throw Error("must not be negative", "PlaneMaskOptions.sigmas");
  MaskImage mask = MaskImage::Zero(frame.depth_m.rows(), frame.depth_m.cols());
  if (planes.empty()) return mask;
  const Points directions = pixel_directions(frame.camera);
  const Vec3 eye = frame.T_base_camera.translation();
  for (std::size_t p = 0; p < planes.size(); ++p) {
    const Vec3 normal = planes[p].normal.normalized();
    const double height = normal.dot(eye - planes[p].point_m);
    if (!(height > 0))
      throw Error("the camera is behind this plane: its normal must point to the side that the camera sees",
                  "environment.planes[" + std::to_string(p) + "]");
    const Vec3 normal_camera = frame.T_base_camera.linear().transpose() * normal;
    for (Eigen::Index row = 0; row < mask.rows(); ++row)
      for (Eigen::Index column = 0; column < mask.cols(); ++column) {
        const double z = frame.depth_m(row, column);
        if (!(z > 0) || mask(row, column)) continue;
        const double fall = -normal_camera.dot(Vec3(directions.row(row * mask.cols() + column)));  // per metre of depth
        const double above = height - z * fall;
        const double cosine = std::abs(fall) / directions.row(row * mask.cols() + column).norm();
        const double sigma = axial_sigma_m(frame.noise, {z, std::acos(std::min(1.0, cosine)), frame.camera.fx_px});
        mask(row, column) = above < options.margin_m + options.sigmas * sigma * std::abs(fall);
      }
  }
  return mask;
}

DepthFrame with_mask(DepthFrame frame, const MaskImage& mask) {
  if (mask.rows() != frame.depth_m.rows() || mask.cols() != frame.depth_m.cols())
    throw Error("must have the size of the frame's image", "mask");
  if (frame.mask.size() == 0)
    frame.mask = mask;
  else
    frame.mask = frame.mask.cwiseMax(mask);
  return frame;
}

}  // namespace palpate::sensing
