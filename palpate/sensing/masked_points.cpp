// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/masked_points.hpp"

#include <cmath>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/sensing/camera.hpp"

namespace palpate::sensing {

Points masked_points(const DepthFrame& frame, const Vec3& low_m, const Vec3& high_m, Index most) {
  if (frame.mask.size() == 0 || most <= 0) return Points(0, 3);
  if (frame.mask.rows() != frame.depth_m.rows() || frame.mask.cols() != frame.depth_m.cols() ||
      frame.camera.width_px != frame.depth_m.cols() || frame.camera.height_px != frame.depth_m.rows()) {
    throw Error("must have the size of the frame's image", "mask");
  }
  const Points directions = pixel_directions(frame.camera);
  std::vector<Vec3> seen;
  for (Index row = 0; row < frame.mask.rows(); ++row) {
    for (Index column = 0; column < frame.mask.cols(); ++column) {
      const double z = frame.depth_m(row, column);
      if (frame.mask(row, column) == 0 || !std::isfinite(z) || !(z > 0)) continue;
      const Vec3 point = frame.T_base_camera * Vec3(z * directions.row(row * frame.mask.cols() + column).transpose());
      if ((point.array() >= low_m.array()).all() && (point.array() <= high_m.array()).all()) seen.push_back(point);
    }
  }
  const Index total = static_cast<Index>(seen.size()), kept = std::min(total, most);
  Points out(kept, 3);
  for (Index i = 0; i < kept; ++i) {
    const auto at = static_cast<std::size_t>(static_cast<std::int64_t>(i) * total / kept);
    out.row(i) = seen[at].transpose();
  }
  return out;
}

}  // namespace palpate::sensing
