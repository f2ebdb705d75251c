// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/rest_change.hpp"

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::sensing {

double changed_share(const DepthFrame& before, const DepthFrame& after) {
  constexpr double sigmas = 5;
  const Eigen::Index rows = before.depth_m.rows(), columns = before.depth_m.cols();
  const auto fits = [&](const auto& image) { return image.rows() == rows && image.cols() == columns; };
  if (!fits(after.depth_m)) throw Error("must have the size of the image before", "changed_share, after");
  for (const DepthFrame* frame : {&before, &after})
    if (frame->mask.size() > 0 && !fits(frame->mask)) throw Error("must have the image's size", "changed_share, mask");
  const auto seen = [](const DepthFrame& frame, Eigen::Index r, Eigen::Index c) {
    return frame.depth_m(r, c) > 0 && (frame.mask.size() == 0 || frame.mask(r, c) == 0);
  };
  MaskImage changed = MaskImage::Zero(rows, columns);
  double common = 0, whole = 0;
  for (Eigen::Index r = 0; r < rows; ++r)
    for (Eigen::Index c = 0; c < columns; ++c) {
      if (!seen(before, r, c) || !seen(after, r, c)) continue;
      ++common;
      const double near = std::min(before.depth_m(r, c), after.depth_m(r, c));
      // Slanted surfaces are noisier than frontal ones; half a right angle is about what objects show.
      const double sigma = axial_sigma_m(after.noise, {near, M_PI / 4, after.camera.fx_px});
      changed(r, c) = std::abs(double(before.depth_m(r, c)) - double(after.depth_m(r, c))) > sigmas * std::sqrt(2.0) * sigma;
    }
  for (Eigen::Index r = 2; r + 2 < rows; ++r)
    for (Eigen::Index c = 2; c + 2 < columns; ++c) whole += changed.block<5, 5>(r - 2, c - 2).minCoeff() > 0;
  return common > 0 ? whole / common : 0;
}

}  // namespace palpate::sensing
