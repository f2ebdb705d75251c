// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/free_space.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::sensing {

FreeSpace::FreeSpace(const std::vector<DepthFrame>& frames, const FreeSpaceOptions& options) {
  if (!(options.sigmas >= 0)) throw Error("must not be negative", "FreeSpaceOptions.sigmas");
  if (!(options.margin_m >= 0)) throw Error("must not be negative", "FreeSpaceOptions.margin_m");
  for (const DepthFrame& frame : frames) {
    check(frame.camera);
    const auto rows = frame.depth_m.rows(), columns = frame.depth_m.cols();
    if (rows != frame.camera.height_px || columns != frame.camera.width_px)
      throw Error("the depth image has another size than its camera", "view " + std::to_string(views_.size()));
    const bool masked = frame.mask.rows() == rows && frame.mask.cols() == columns;
    View view{frame.camera, frame.T_base_camera.inverse(), DepthImage::Zero(rows, columns)};
    for (Eigen::Index r = 0; r < rows; ++r)
      for (Eigen::Index c = 0; c < columns; ++c) {
        const double z = frame.depth_m(r, c);
        if (!(z > 0) || !std::isfinite(z) || (masked && frame.mask(r, c))) continue;
        const double sigma = axial_sigma_m(frame.noise, {z, 0, frame.camera.fx_px});
        const double pose = std::hypot(frame.pose_std_m, z * frame.pose_std_rad);
        view.free_m(r, c) = static_cast<float>(std::max(0.0, z - options.margin_m - options.sigmas * std::hypot(sigma, pose)));
      }
    // the nearest of the neighbours counts, and one without data is asked for none
    const DepthImage own = view.free_m;
    for (Eigen::Index r = 0; r < rows; ++r)
      for (Eigen::Index c = 0; c < columns; ++c) {
        if (!(own(r, c) > 0)) continue;
        for (Eigen::Index a = std::max<Eigen::Index>(0, r - 1); a <= std::min(rows - 1, r + 1); ++a)
          for (Eigen::Index b = std::max<Eigen::Index>(0, c - 1); b <= std::min(columns - 1, c + 1); ++b)
            if (own(a, b) > 0) view.free_m(r, c) = std::min(view.free_m(r, c), own(a, b));
      }
    views_.push_back(std::move(view));
  }
}

bool FreeSpace::operator()(const Vec3& point_base_m) const {
  for (const View& view : views_) {
    const Vec3 p = view.T_camera_base * point_base_m;
    const auto pixel = project(view.camera, p);
    if (!pixel) continue;
    const auto c = static_cast<Eigen::Index>(std::lround(pixel->x())), r = static_cast<Eigen::Index>(std::lround(pixel->y()));
    if (r < 0 || c < 0 || r >= view.free_m.rows() || c >= view.free_m.cols()) continue;
    if (p.z() < view.free_m(r, c)) return true;
  }
  return false;
}

}  // namespace palpate::sensing
