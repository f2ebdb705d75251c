// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/scene.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/sensing/camera.hpp"

namespace palpate::lab::scene_test {
namespace {

TEST(Scene, CylinderOnATableSeenFromTheSide) {
  const geometry::TriangleTree rod(cylinder(0.05, 0.3, 400));
  Camera camera;
  camera.width_px = 80;
  camera.height_px = 60;
  camera.fx_px = camera.fy_px = 70;
  camera.cx_px = 39.5;
  camera.cy_px = 29.5;
  const Vec3 eye(0, -0.6, 0.15);
  const PerfectView view = cast_view({{&rod}, {Plane{}}}, camera, look_at(eye, Vec3(0, 0, 0.15)));
  for (int row = 0; row < 60; ++row)
    for (int column = 0; column < 80; ++column) {
      const Vec3 ray = look_at(eye, Vec3(0, 0, 0.15)).linear() * *sensing::unproject(camera, Vec2(column, row));
      // closed form: circle in x-y, then the table
      const double a = ray.head<2>().squaredNorm(), b = eye.head<2>().dot(ray.head<2>());
      const double under = b * b - a * (eye.head<2>().squaredNorm() - 0.0025);
      double expected = 0;
      int label = 0;
      if (under > 1e-4) {
        const double t = (-b - std::sqrt(under)) / a;
        if (eye.z() + t * ray.z() > 0 && eye.z() + t * ray.z() < 0.3) expected = t, label = 1;
      } else if (under > -1e-4) {
        continue;  // the polygon's rim
      }
      if (label == 0 && ray.z() < 0) expected = -eye.z() / ray.z(), label = 2;
      EXPECT_NEAR(view.depth_m(row, column), expected, 1e-4 + 1e-6 * expected) << row << " " << column;
      EXPECT_EQ(view.label(row, column), label);
      if (label == 2) {
        EXPECT_NEAR(view.incidence_rad(row, column), std::acos(-ray.z() / ray.norm()), 1e-4);
      }
    }
}

TEST(Scene, LookAtIsARightHandedCamera) {
  const Pose pose = look_at(Vec3(1, 2, 3), Vec3(0, 0.5, 0.2));
  EXPECT_NEAR(pose.linear().determinant(), 1, 1e-12);
  EXPECT_NEAR((pose.linear() * pose.linear().transpose() - Mat3::Identity()).norm(), 0, 1e-12);
  const Vec3 target = pose.inverse() * Vec3(0, 0.5, 0.2);
  EXPECT_NEAR(target.head<2>().norm(), 0, 1e-12);
  EXPECT_GT(target.z(), 0);
  EXPECT_LT(pose.linear().col(1).z(), 0) << "y points down";
  EXPECT_THROW(look_at(Vec3::Zero(), Vec3::UnitZ()), Error);
}

}  // namespace
}  // namespace palpate::lab::scene_test
