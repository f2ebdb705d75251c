// SPDX-License-Identifier: Apache-2.0
// Some of the rays of a cloud.
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::geometry {

inline RayCloud rays_at(const RayCloud& all, const std::vector<Index>& rows) {
  RayCloud some{all.origins_m(rows, Eigen::all), all.directions(rows, Eigen::all), all.range_m(rows), all.sigma_m(rows), {}};
  if (all.pixel.rows() == all.range_m.size()) some.pixel = all.pixel(rows, Eigen::all);
  return some;
}

}  // namespace palpate::geometry
