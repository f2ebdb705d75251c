// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/lens_scatter.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/sensing/back_projection.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::sensing {

std::optional<LensScatter> lens_scatter(const DepthFrame& frame) {
  LensScatter out;
  const DepthNoise& noise = frame.noise;
  if (!std::isnan(noise.lens_scatter_std)) {
    out.share_std = noise.lens_scatter_std;
  } else if (noise.model != "constant") {
    out.share_std = depth_noise_model(noise.model).lens_scatter_std;
  }
  if (!(out.share_std > 0)) return std::nullopt;
  DepthFrame whole = frame;
  whole.mask.resize(0, 0);
  BackProjectionOptions coarse;
  coarse.stride_px = std::max(1, std::min(frame.camera.width_px, frame.camera.height_px) / 60);  // some thousand pixels
  coarse.max_incidence_rad = 0.5 * M_PI;
  Points normals;
  const RayCloud rays = back_project(whole, coarse, &normals);
  for (Index i = 0; i < rays.range_m.size(); ++i) {
    const double range_m = rays.range_m(i), cosine = std::abs(normals.row(i).dot(rays.directions.row(i)));
    out.mean_light += std::polar(cosine / (range_m * range_m), LensScatter::phase_per_m * range_m);
  }
  const auto strides = [&](int size_px) { return (size_px + coarse.stride_px - 1) / coarse.stride_px; };
  out.mean_light /= static_cast<double>(strides(frame.camera.width_px)) * strides(frame.camera.height_px);
  return out;
}

}  // namespace palpate::sensing
