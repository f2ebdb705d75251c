// SPDX-License-Identifier: Apache-2.0
// The peer of the ICP table, in a file of its own: it is compiled in where the machine has Open3D, and never linked into the
// product.
#include <algorithm>

#include "bars.hpp"
#ifdef PALPATE_WITH_OPEN3D
#include <open3d/geometry/KDTreeSearchParam.h>
#include <open3d/geometry/PointCloud.h>
#include <open3d/pipelines/registration/Registration.h>
#include <open3d/pipelines/registration/TransformationEstimation.h>
#endif

namespace bars {

#ifdef PALPATE_WITH_OPEN3D
double open3d_icp(const PointCloud& cloud, const TriMesh& mesh, const Pose& start, Pose& found) {
  static open3d::geometry::PointCloud target;
  if (target.points_.empty()) {  // 100 000 samples by area
    std::vector<double> cumulative;
    double area = 0;
    const auto corner = [&](Index t, int k) { return Vec3(mesh.vertices_m.row(mesh.triangles(t, k)).transpose()); };
    for (Index t = 0; t < mesh.triangles.rows(); ++t)
      cumulative.push_back(area += (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm());
    std::mt19937 rng(1);
    std::uniform_real_distribution<double> u;
    for (int i = 0; i < 100000; ++i) {
      const double at = u(rng) * area;
      const auto t = static_cast<Index>(std::lower_bound(cumulative.begin(), cumulative.end(), at) - cumulative.begin());
      double a = u(rng), b = u(rng);
      if (a + b > 1) a = 1 - a, b = 1 - b;
      target.points_.push_back((1 - a - b) * corner(t, 0) + a * corner(t, 1) + b * corner(t, 2));
      target.normals_.push_back((corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).normalized());
    }
  }
  open3d::geometry::PointCloud source;
  for (Index i = 0; i < cloud.points_m.rows(); ++i) source.points_.emplace_back(cloud.points_m.row(i).transpose());
  namespace peer = open3d::pipelines::registration;
  const Stopwatch watch;
  const auto result =
      peer::RegistrationICP(source, target, 0.03, start.matrix(), peer::TransformationEstimationPointToPlane(),
                            peer::ICPConvergenceCriteria(1e-6, 1e-6, 50));
  const double seconds = watch.seconds();
  found.matrix() = result.transformation_;
  return seconds;
}
#else
double open3d_icp(const PointCloud&, const TriMesh&, const Pose&, Pose&) { return -1; }
#endif

}  // namespace bars
