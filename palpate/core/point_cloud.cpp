// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/point_cloud.hpp"

#include "palpate/core/error.hpp"

namespace palpate {

PointCloud chosen_points(const PointCloud& cloud, const std::vector<Index>& points) {
  PointCloud out = cloud;
  out.points_m = cloud.points_m(points, Eigen::all);
  if (cloud.normals.rows() == cloud.points_m.rows()) out.normals = cloud.normals(points, Eigen::all);
  if (cloud.sigma_m.size() > 1) out.sigma_m = cloud.sigma_m(points);
  return out;
}

void demand_sigmas(const PointCloud& cloud) {
  if (cloud.sigma_m.size() != 1 && cloud.sigma_m.size() != cloud.points_m.rows())
    throw Error("give one standard deviation, or one a point", "cloud.sigma_m");
}

}  // namespace palpate
