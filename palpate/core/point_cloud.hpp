// SPDX-License-Identifier: Apache-2.0
// What rooms do with the points of a cloud.
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate {

/// Those points (each as often as it is named) with their normals and standard deviations.
PointCloud chosen_points(const PointCloud& cloud, const std::vector<Index>& points);

/// @throws Error when sigma_m has neither one value nor one a point
void demand_sigmas(const PointCloud& cloud);

/// Standard deviation of one point, per axis, of a cloud that demand_sigmas bears.
inline double sigma_of_m(const PointCloud& cloud, Index point) { return cloud.sigma_m(cloud.sigma_m.size() == 1 ? 0 : point); }

}  // namespace palpate
