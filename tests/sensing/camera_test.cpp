// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/camera.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"

namespace palpate::sensing::camera_test {
namespace {

Camera pinhole() {
  Camera camera;
  camera.width_px = 640;
  camera.height_px = 480;
  camera.fx_px = 525;
  camera.fy_px = 530;
  camera.cx_px = 319.5;
  camera.cy_px = 239.5;
  return camera;
}

Camera with(DistortionModel model, std::vector<double> coefficients) {
  Camera camera = pinhole();
  camera.distortion = model;
  camera.distortion_coefficients = std::move(coefficients);
  return camera;
}

class EveryModel : public testing::TestWithParam<Camera> {};

TEST_P(EveryModel, UnprojectInvertsProject) {
  const Camera camera = GetParam();
  check(camera);
  for (int v = 0; v < 480; v += 37)
    for (int u = 0; u < 640; u += 41) {
      const auto direction = unproject(camera, Vec2(u, v));
      ASSERT_TRUE(direction) << u << " " << v;
      EXPECT_DOUBLE_EQ(direction->z(), 1.0);
      const auto pixel = project(camera, 0.7 * *direction);
      ASSERT_TRUE(pixel);
      EXPECT_NEAR((*pixel - Vec2(u, v)).norm(), 0, 1e-8);
    }
}

TEST_P(EveryModel, DerivativeAgreesWithFiniteDifferences) {
  const Camera camera = GetParam();
  for (const Vec3& point : {Vec3(0.21, -0.13, 0.8), Vec3(-0.3, 0.25, 1.1), Vec3(1e-7, 0, 0.6)}) {
    Eigen::Matrix<double, 2, 3> derivative;
    ASSERT_TRUE(project(camera, point, &derivative));
    for (int k = 0; k < 3; ++k) {
      const double h = 1e-5;
      Vec3 ahead = point, behind = point;
      ahead(k) += h;
      behind(k) -= h;
      const Vec2 difference = (*project(camera, ahead) - *project(camera, behind)) / (2 * h);
      EXPECT_NEAR((difference - derivative.col(k)).norm(), 0, 1e-5) << "axis " << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Camera, EveryModel,
                         testing::Values(pinhole(), with(DistortionModel::plumb_bob, {0.1, -0.25, 0.001, -0.0005}),
                                         with(DistortionModel::plumb_bob, {-0.05, 0.06, -0.001, 0.002, -0.02}),
                                         with(DistortionModel::rational, {0.5, -2.6, 0.0006, -0.0002, 1.5, 0.4, -2.5, 1.4}),
                                         with(DistortionModel::fisheye, {-0.03, 0.01, -0.004, 0.001})));

TEST(Camera, PinholeClosedForm) {
  const auto pixel = project(pinhole(), Vec3(0.1, -0.2, 0.5));
  ASSERT_TRUE(pixel);
  EXPECT_DOUBLE_EQ(pixel->x(), 525 * 0.2 + 319.5);
  EXPECT_DOUBLE_EQ(pixel->y(), 530 * -0.4 + 239.5);
}

TEST(Camera, PlumbBobWorkedByHand) {
  const Camera camera = with(DistortionModel::plumb_bob, {0.1, 0.02, 0.01, 0.03, 0.5});
  // x = 0.5, y = -0.25: r2 = 0.3125
  const double r2 = 0.3125, radial = 1 + 0.1 * r2 + 0.02 * r2 * r2 + 0.5 * r2 * r2 * r2;
  const double x = 0.5 * radial + 2 * 0.01 * 0.5 * -0.25 + 0.03 * (r2 + 2 * 0.25);
  const double y = -0.25 * radial + 0.01 * (r2 + 2 * 0.0625) + 2 * 0.03 * 0.5 * -0.25;
  const auto pixel = project(camera, Vec3(1, -0.5, 2));
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x(), 525 * x + 319.5, 1e-10);
  EXPECT_NEAR(pixel->y(), 530 * y + 239.5, 1e-10);
}

TEST(Camera, FisheyeWithoutCoefficientsIsEquidistant) {
  const Camera camera = with(DistortionModel::fisheye, {0, 0, 0, 0});
  const double theta = 1.2;
  const auto pixel = project(camera, Vec3(std::sin(theta), 0, std::cos(theta)));
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x(), 525 * theta + 319.5, 1e-10);
}

TEST(Camera, NothingBehindOrBeyondTheFold) {
  EXPECT_FALSE(project(pinhole(), Vec3(0, 0, -1)));
  EXPECT_FALSE(project(pinhole(), Vec3(0, 0, 0)));
  // r (1 - r^2) has its maximum 0.385 at r = 0.577: no direction sees a pixel farther out.
  const Camera folded = with(DistortionModel::plumb_bob, {-1, 0, 0, 0});
  EXPECT_TRUE(unproject(folded, Vec2(319.5 + 525 * 0.38, 239.5)));
  EXPECT_FALSE(unproject(folded, Vec2(319.5 + 525 * 0.39, 239.5)));
  const Points directions = pixel_directions(folded);
  EXPECT_TRUE(std::isnan(directions(0, 0)));
  EXPECT_TRUE(std::isfinite(directions(240 * 640 + 320, 0)));
  // What lies farther out has no image: the polynomial would put it back into the picture, at x = 1.2 left of the middle.
  EXPECT_TRUE(project(folded, Vec3(0.57, 0, 1)));
  for (const double x : {0.58, 0.9, 1.2, 5.0}) EXPECT_FALSE(project(folded, Vec3(x, 0, 1))) << x;
  // k2 turns the polynomial up again, 1 - 3 r^2 + 1.75 r^4 = 0 at r = 0.67: beyond it is seen by nobody all the same.
  const Camera wavy = with(DistortionModel::plumb_bob, {-1, 0.35, 0, 0});
  EXPECT_TRUE(project(wavy, Vec3(0, 0.66, 1)));
  for (const double y : {0.68, 1.0, 1.5, 3.0}) EXPECT_FALSE(project(wavy, Vec3(0, y, 1))) << y;
  EXPECT_FALSE(unproject(wavy, Vec2(319.5 + 525 * 2.0, 239.5))) << "on the branch beyond the fold";
  const Camera fisheye = with(DistortionModel::fisheye, {-0.3, 0, 0, 0});  // theta - 0.3 theta^3 turns at 1.054
  EXPECT_TRUE(project(fisheye, Vec3(std::sin(1.05), 0, std::cos(1.05))));
  EXPECT_FALSE(project(fisheye, Vec3(std::sin(1.06), 0, std::cos(1.06))));
}

TEST(Camera, BadFieldsAreNamed) {
  const auto where = [](Camera camera) -> std::string {
    try {
      check(camera);
    } catch (const Error& error) {
      return error.where();
    }
    return "accepted";
  };
  Camera camera = pinhole();
  EXPECT_EQ(where(camera), "accepted");
  camera.width_px = 0;
  EXPECT_THAT(where(camera), testing::HasSubstr("width_px"));
  camera = pinhole();
  camera.fy_px = -1;
  EXPECT_THAT(where(camera), testing::HasSubstr("fy_px"));
  camera = pinhole();
  camera.cx_px = NAN;
  EXPECT_THAT(where(camera), testing::HasSubstr("cx_px"));
  for (const auto model :
       {DistortionModel::none, DistortionModel::plumb_bob, DistortionModel::rational, DistortionModel::fisheye})
    EXPECT_THAT(where(with(model, {0.1, 0.2, 0.3})), testing::HasSubstr("distortion_coefficients"));
}

}  // namespace
}  // namespace palpate::sensing::camera_test
