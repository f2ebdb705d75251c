// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/plane_mask.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::sensing {
namespace {

// Of the pixels around one that have data; 0 where none has. Not of itself: what stays would else know its own noise.
double median_around_m(const DepthImage& depth_m, Eigen::Index row, Eigen::Index column, int window_px,
                       std::vector<float>& scratch) {
  scratch.clear();
  for (Eigen::Index r = std::max<Eigen::Index>(0, row - window_px); r <= std::min(depth_m.rows() - 1, row + window_px); ++r)
    for (Eigen::Index c = std::max<Eigen::Index>(0, column - window_px); c <= std::min(depth_m.cols() - 1, column + window_px);
         ++c)
      if (depth_m(r, c) > 0 && (r != row || c != column)) scratch.push_back(depth_m(r, c));
  if (scratch.empty()) return 0;
  const auto middle = scratch.begin() + std::ptrdiff_t(scratch.size() / 2);
  std::nth_element(scratch.begin(), middle, scratch.end());
  return *middle;
}

}  // namespace

void check(const PlaneMaskOptions& options) {
  if (!(options.margin_m >= 0)) throw Error("must not be negative", "PlaneMaskOptions.margin_m");
  if (!(options.sigmas >= 0)) throw Error("must not be negative", "PlaneMaskOptions.sigmas");
  if (options.window_px < 0) throw Error("must not be negative", "PlaneMaskOptions.window_px");
}

MaskImage mask_planes(const DepthFrame& frame, const std::vector<Plane>& planes, const PlaneMaskOptions& options) {
  check(options);
  MaskImage mask = MaskImage::Zero(frame.depth_m.rows(), frame.depth_m.cols());
  std::vector<float> scratch;
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
        double z = frame.depth_m(row, column);
        if (!(z > 0) || mask(row, column)) continue;
        const double fall = -normal_camera.dot(Vec3(directions.row(row * mask.cols() + column)));  // per metre of depth
        const double cosine = std::abs(fall) / directions.row(row * mask.cols() + column).norm();
        const double sigma = axial_sigma_m(frame.noise, {z, std::acos(std::min(1.0, cosine)), frame.camera.fx_px});
        const double margin_m = options.margin_m + options.sigmas * sigma * std::abs(fall);
        // Only where the noise might decide, and not across a depth edge, where the neighbours show something else.
        if (options.window_px > 0 && std::abs(height - z * fall - margin_m) < 6 * sigma * std::abs(fall)) {
          const double median = median_around_m(frame.depth_m, row, column, options.window_px, scratch);
          const double slope_m = 3 * options.window_px * z / std::min(frame.camera.fx_px, frame.camera.fy_px);
          if (std::abs(median - z) < 5 * sigma + slope_m) z = median;
        }
        mask(row, column) = height - z * fall < margin_m;
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

bool is_blank(const DepthFrame& frame) {
  const bool masked = frame.mask.size() == frame.depth_m.size();
  for (Eigen::Index i = 0; i < frame.depth_m.size(); ++i)
    if (frame.depth_m.data()[i] > 0 && !(masked && frame.mask.data()[i] != 0)) return false;
  return true;
}

}  // namespace palpate::sensing
