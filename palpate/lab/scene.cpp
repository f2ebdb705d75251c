// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/scene.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/sensing/camera.hpp"

namespace palpate::lab {

PerfectView cast_view(const Scene& scene, const Camera& camera, const Pose& T_base_camera) {
  const Points directions = sensing::pixel_directions(camera);
  PerfectView view;
  view.depth_m = DepthImage::Zero(camera.height_px, camera.width_px);
  view.incidence_rad = DepthImage::Zero(camera.height_px, camera.width_px);
  view.label = MaskImage::Zero(camera.height_px, camera.width_px);
  const Vec3 eye = T_base_camera.translation();
  for (int row = 0; row < camera.height_px; ++row)
    for (int column = 0; column < camera.width_px; ++column) {
      const Vec3 ray_camera = directions.row(Eigen::Index(row) * camera.width_px + column);
      if (!ray_camera.allFinite()) continue;
      const Vec3 ray = T_base_camera.linear() * ray_camera;  // a parameter of 1 is a depth of 1
      double nearest = 1e300, cosine = 1;
      int label = 0;
      for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
        const auto hit = scene.bodies[b]->cast(eye, ray, nearest);
        if (!hit || !(hit->range_m < nearest)) continue;
        const TriMesh& mesh = scene.bodies[b]->mesh();
        const auto triangle = mesh.triangles.row(hit->triangle);
        const Vec3 a = mesh.vertices_m.row(triangle(0)), p = mesh.vertices_m.row(triangle(1)),
                   q = mesh.vertices_m.row(triangle(2));
        const Vec3 normal = (p - a).cross(q - a);
        nearest = hit->range_m;
        cosine = std::abs(normal.dot(ray)) / (normal.norm() * ray.norm());
        label = 1 + int(b);
      }
      for (std::size_t k = 0; k < scene.planes.size(); ++k) {
        const Vec3& normal = scene.planes[k].normal;
        const double fall = -normal.dot(ray);
        if (!(fall > 0)) continue;
        const double range = normal.dot(eye - scene.planes[k].point_m) / fall;
        if (!(range > 0) || range >= nearest) continue;
        nearest = range;
        cosine = fall / (normal.norm() * ray.norm());
        label = 1 + int(scene.bodies.size()) + int(k);
      }
      if (label == 0) continue;
      view.depth_m(row, column) = float(nearest);
      view.incidence_rad(row, column) = float(std::acos(std::min(1.0, cosine)));
      view.label(row, column) = std::uint8_t(label);
    }
  return view;
}

Pose look_at(const Vec3& eye_m, const Vec3& target_m, const Vec3& up) {
  const Vec3 forward = (target_m - eye_m).normalized();
  const Vec3 right = forward.cross(up);
  if (!(right.norm() > 1e-9)) throw Error("must not be parallel to the line of sight", "up");
  Pose pose = Pose::Identity();
  pose.linear().col(0) = right.normalized();
  pose.linear().col(1) = forward.cross(right.normalized());
  pose.linear().col(2) = forward;
  pose.translation() = eye_m;
  return pose;
}

TriMesh cylinder(double radius_m, double length_m, int sides) {
  TriMesh mesh;
  mesh.vertices_m.resize(2 * sides + 2, 3);
  mesh.triangles.resize(4 * sides, 3);
  const Index bottom = 2 * sides, top = 2 * sides + 1;
  mesh.vertices_m.row(bottom) << 0, 0, 0;
  mesh.vertices_m.row(top) << 0, 0, length_m;
  for (Index k = 0; k < sides; ++k) {
    const double angle = 2 * M_PI * k / sides;
    mesh.vertices_m.row(k) << radius_m * std::cos(angle), radius_m * std::sin(angle), 0;
    mesh.vertices_m.row(sides + k) << radius_m * std::cos(angle), radius_m * std::sin(angle), length_m;
    const Index next = (k + 1) % sides;
    mesh.triangles.row(4 * k + 0) << bottom, next, k;
    mesh.triangles.row(4 * k + 1) << top, sides + k, sides + next;
    mesh.triangles.row(4 * k + 2) << k, next, sides + next;
    mesh.triangles.row(4 * k + 3) << k, sides + next, sides + k;
  }
  return mesh;
}

}  // namespace palpate::lab
