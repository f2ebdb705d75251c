// SPDX-License-Identifier: Apache-2.0
// One noisy view of a mesh against that mesh: pose error in units of the Cramer-Rao bound, what the covariance says of it,
// and CPU seconds beside Open3D's point-to-plane ICP on the same clouds and starts.
#include "palpate/registration/icp.hpp"

#include <fmt/core.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "bars.hpp"
#include "palpate/io/mesh_file.hpp"

namespace bars {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

Vector6 as_vector(const Pose& T) {
  const Eigen::AngleAxisd a(T.linear());
  Vector6 v;
  v << a.angle() * a.axis(), T.translation();
  return v;
}

double median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

bool row(const geometry::TriangleTree& tree, int width, int height, double focal, int seeds) {
  constexpr double sigma = 0.0012;
  std::vector<double> ours, ours_s, theirs, theirs_s;
  double normalised = 0;
  Index points = 0;
  for (int s = 0; s < seeds; ++s) {
    std::mt19937 rng(100 + s);
    const CameraView v = depth_view(tree, Vec3(0.3, -0.5, 1), 0.5, width, height, focal, sigma, rng);
    points = static_cast<Index>(v.cloud.points_m.rows());
    // information of the points about the pose: correspondences and normals known, sigma for every distance
    registration::Matrix6 h = registration::Matrix6::Zero();
    for (Index i = 0; i < points; ++i) {
      const Vec3 p = v.cloud.points_m.row(i).transpose(), n = v.cloud.normals.row(i).transpose();
      Vector6 j;
      j << p.cross(n), n;
      h += j * j.transpose() / (sigma * sigma);
    }
    const Pose start = random_motion(5 * M_PI / 180, 0.01, rng);
    const Stopwatch watch;
    registration::IcpOptions o;
    o.sensor_m = 0.5 * Vec3(0.3, -0.5, 1).normalized();
    const auto r = registration::align(v.cloud, tree, start, o);
    ours_s.push_back(watch.seconds());
    const auto in_bounds = [&](const Vector6& d) { return std::sqrt(d.dot(h * d) / 6); };
    const Vector6 d = as_vector(r.T_surface_cloud);
    ours.push_back(in_bounds(d));
    normalised += d.dot(r.covariance.ldlt().solve(d)) / (6.0 * seeds);
    Pose found;
    if (const double seconds = s < 10 ? open3d_icp(v.cloud, tree.mesh(), start, found) : -1; seconds >= 0) {
      theirs_s.push_back(seconds);
      theirs.push_back(in_bounds(as_vector(found)));
    }
  }
  const double mid = median(ours), worst = *std::max_element(ours.begin(), ours.end()), time = median(ours_s);
  const bool peer = !theirs.empty();
  const bool holds = mid <= 1.1 && worst <= 3 && std::abs(normalised - 1) < 0.3 && (!peer || time <= median(theirs_s));
  fmt::print("| {} | {} | {:.2f} | {:.2f} | {:.2f} | {:.0f} ms | {} | {} | {} |\n", points, seeds, mid, worst, normalised,
             1e3 * time, peer ? fmt::format("{:.0f} ms", 1e3 * median(theirs_s)) : "-",
             peer ? fmt::format("{:.2f}", median(theirs)) : "-", verdict(holds));
  std::fflush(stdout);
  return holds;
}

}  // namespace

bool icp(const std::filesystem::path& meshes, int seeds) {
  const auto file = meshes / "bunny_stanford.obj";
  if (!std::filesystem::exists(file)) {
    fmt::print("\nICP: no {}\n", file.string());
    return true;
  }
  fmt::print(
      "\nPoint-to-plane ICP of one view (noise 1.2 mm along the ray) against the bunny of 69 630 triangles and 0.14 m, "
      "started "
      "5 degrees and 10 mm off. Errors in units of the Cramer-Rao bound; covariance: mean squared error over what it "
      "says\n\n"
      "| points | seeds | median error | worst | covariance | CPU | Open3D CPU | its median error | holds |\n"
      "|---|---|---|---|---|---|---|---|---|\n");
  const geometry::TriangleTree tree(scaled(io::read_tri_mesh(file), 0.14));
  const bool small = row(tree, 640, 480, 525, seeds), large = row(tree, 1280, 960, 1700, seeds);
  return small && large;
}

}  // namespace bars
