// SPDX-License-Identifier: Apache-2.0
#include "bars.hpp"

#include <algorithm>
#include <cmath>

namespace bars {

std::vector<std::filesystem::path> mesh_files(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> out;
  if (!std::filesystem::is_directory(folder)) return out;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".obj") out.push_back(entry.path());
  std::sort(out.begin(), out.end());
  return out;
}

TriMesh scaled(TriMesh mesh, double size_m) {
  const Eigen::RowVector3d low = mesh.vertices_m.colwise().minCoeff(), high = mesh.vertices_m.colwise().maxCoeff();
  mesh.vertices_m = ((mesh.vertices_m.rowwise() - 0.5 * (low + high)) * (size_m / (high - low).maxCoeff())).eval();
  return mesh;
}

CameraView depth_view(const geometry::TriangleTree& tree, const Vec3& from, double distance_m, int width_px, int height_px,
                      double focal_px, double sigma_m, std::mt19937& rng, int stride) {
  std::normal_distribution<double> g;
  const Vec3 back = from.normalized(), eye = distance_m * back, u = back.unitOrthogonal(), v = back.cross(u);
  const TriMesh& m = tree.mesh();
  std::vector<Vec3> points, normals;
  std::vector<double> cosines;
  CameraView out;
  // (x, y) right-handed about the line of sight: the picture's columns run along v
  out.image.camera.width_px = height_px, out.image.camera.height_px = width_px;
  out.image.camera.fx_px = out.image.camera.fy_px = focal_px;
  out.image.camera.cx_px = height_px / 2.0, out.image.camera.cy_px = width_px / 2.0;
  out.image.T_base_camera.linear() << v, u, -back;
  out.image.T_base_camera.translation() = eye;
  out.image.depth_m = DepthImage::Zero(width_px, height_px);
  out.image.noise.sigma_m = sigma_m;
  for (int y = 0; y < height_px; y += stride)
    for (int x = 0; x < width_px; x += stride) {
      const Vec3 d = (-back + (x - width_px / 2.0) / focal_px * u + (y - height_px / 2.0) / focal_px * v).normalized();
      const auto hit = tree.cast(eye, d);
      if (!hit) {
        out.image.depth_m(x, y) = float(wall_m);
        continue;
      }
      const auto corner = [&](int k) { return Vec3(m.vertices_m.row(m.triangles(hit->triangle, k)).transpose()); };
      const Vec3 n = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
      if (-n.dot(d) < 0.2) continue;  // sensors see nothing at grazing angles
      points.push_back(eye + (hit->range_m + sigma_m * g(rng)) * d);
      out.image.depth_m(x, y) = float((points.back() - eye).dot(-back));
      normals.push_back(n);
      cosines.push_back(-n.dot(d));
    }
  const auto count = static_cast<Index>(points.size());
  out.cloud.points_m.resize(count, 3);
  out.cloud.normals.resize(count, 3);
  out.cosine.resize(count);
  for (Index i = 0; i < count; ++i) {
    out.cloud.points_m.row(i) = points[i].transpose();
    out.cloud.normals.row(i) = normals[i].transpose();
    out.cosine[i] = cosines[i];
  }
  out.cloud.sigma_m = VectorX::Constant(1, sigma_m);
  return out;
}

Pose random_motion(double angle_rad, double shift_m, std::mt19937& rng) {
  std::normal_distribution<double> g;
  const Vec3 axis = Vec3(g(rng), g(rng), g(rng)).normalized(), shift = shift_m * Vec3(g(rng), g(rng), g(rng)).normalized();
  return Pose(Eigen::Translation3d(shift) * Eigen::AngleAxisd(angle_rad, axis));
}

void apply(const Pose& T, PointCloud& cloud) {
  cloud.points_m = ((cloud.points_m * T.linear().transpose()).rowwise() + T.translation().transpose()).eval();
  cloud.normals = (cloud.normals * T.linear().transpose()).eval();
}

}  // namespace bars
