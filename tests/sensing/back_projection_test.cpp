// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/back_projection.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

#include "palpate/core/error.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/depth_noise.hpp"
#include "refusals.hpp"

namespace palpate::sensing::back_projection_test {
namespace {

DepthFrame empty_frame() {
  DepthFrame frame;
  frame.camera.width_px = 160;
  frame.camera.height_px = 120;
  frame.camera.fx_px = frame.camera.fy_px = 140;
  frame.camera.cx_px = 79.5;
  frame.camera.cy_px = 59.5;
  frame.depth_m = DepthImage::Zero(120, 160);
  frame.noise = {"constant", 0.002, 0};
  return frame;
}

// Depth of the plane n . x = distance, seen exactly.
DepthFrame see_plane(const Vec3& normal, double distance_m, DepthFrame frame = empty_frame()) {
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 160; ++column) {
      const auto ray = unproject(frame.camera, Vec2(column, row));
      frame.depth_m(row, column) = float(distance_m / normal.dot(*ray));
    }
  return frame;
}

// An image in whole millimetres, or in whatever its format counts, is off by its rounding as well.
TEST(BackProjection, RoundedDepthsAreOffByTheirRounding) {
  const DepthFrame exact = see_plane(Vec3(0.3, -0.4, -0.8).normalized(), -0.6);
  EXPECT_EQ(depth_step_m(exact.depth_m), 0);
  for (const double step_m : {1e-3, 1.25e-4, 1e-4}) {
    DepthFrame rounded = exact;
    rounded.depth_m = (exact.depth_m.array() / float(step_m)).round() * float(step_m);
    rounded.depth_m(3, 4) = 0;
    rounded.depth_m(5, 6) = std::nanf("");
    rounded.noise.sigma_m = 2e-4;
    EXPECT_EQ(depth_step_m(rounded.depth_m), step_m);
    const RayCloud coarse = back_project(rounded);
    const double root = (rounded.depth_m - exact.depth_m).cast<double>().block(20, 20, 80, 80).norm() / 80;
    EXPECT_NEAR(root / (step_m / std::sqrt(12.0)), 1, 0.05);
    const double stretch = unproject(rounded.camera, coarse.pixel.row(0).cast<double>().transpose())->norm();
    EXPECT_NEAR(coarse.sigma_m(0) / stretch / std::hypot(2e-4, root), 1, 0.05);
  }
  EXPECT_EQ(depth_step_m(DepthImage::Constant(9, 9, 0.7F)), 0) << "one depth says nothing of steps";
}

TEST(BackProjection, PlaneIsReproducedExactlyInTheBaseFrame) {
  const Vec3 normal = Vec3(0.3, -0.4, -0.8).normalized();
  DepthFrame frame = see_plane(normal, -0.6);
  frame.camera.distortion = DistortionModel::plumb_bob;
  frame.camera.distortion_coefficients = {0.05, -0.1, 0.001, 0.001};
  frame = see_plane(normal, -0.6, frame);
  frame.T_base_camera = Eigen::Translation3d(0.5, -0.2, 1.1) * Eigen::AngleAxisd(2.1, Vec3(1, 2, 0.5).normalized());
  Points normals_base;
  const RayCloud rays = back_project(frame, {}, &normals_base);
  ASSERT_EQ(rays.range_m.size(), 160 * 120);
  const PointCloud cloud = to_point_cloud(rays, normals_base);
  for (Eigen::Index i = 0; i < cloud.points_m.rows(); i += 17) {
    const Vec3 seen = frame.T_base_camera.inverse() * Vec3(cloud.points_m.row(i));
    EXPECT_NEAR(normal.dot(seen), -0.6, 1e-6);
    EXPECT_NEAR((Vec3(normals_base.row(i)) - frame.T_base_camera.linear() * normal).norm(), 0, 1e-4);
    EXPECT_NEAR(rays.directions.row(i).norm(), 1, 1e-12);
    const auto pixel = project(frame.camera, seen);
    EXPECT_NEAR((*pixel - rays.pixel.row(i).cast<double>().transpose()).norm(), 0, 1e-4);
    // 2 mm along the axis are more along an oblique ray.
    EXPECT_NEAR(rays.sigma_m(i), 0.002 * rays.range_m(i) / seen.z(), 1e-9);
  }
}

// Noise goes along the ray: of a plane that ends in the picture, what is measured beyond its end lies before or behind it on average. The
// plane that the normal was fitted with averages pixels and not places.
TEST(BackProjection, SmoothDepthsDoNotCurlInAtTheRim) {
  constexpr double sigma_m = 0.004, distance_m = -0.6;
  const Vec3 normal(0, -0.8, -0.6), along(0, 0.6, -0.8);  // along the plane, to where the picture ends
  DepthFrame frame = see_plane(normal, distance_m);
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0, float(sigma_m));
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 160; ++column) frame.depth_m(row, column) += noise(random);
  frame.noise.sigma_m = sigma_m;
  frame.mask = MaskImage::Zero(120, 160);
  frame.mask.bottomRows(50).setOnes();
  const Vec3 end_m = *unproject(frame.camera, Vec2(79.5, 69));
  const double end_at_m = distance_m / normal.dot(end_m) * along.dot(end_m);
  struct Off {
    double rms_m = 0, at_the_end_m = 0;
  };
  const auto off = [&](bool smooth) {
    BackProjectionOptions options;
    options.smooth = smooth;
    options.remove_edges = false;
    const PointCloud cloud = to_point_cloud(back_project(frame, options));
    double squares = 0, beyond = 0;
    Index count = 0;
    for (Index i = 0; i < cloud.points_m.rows(); ++i) {
      const Vec3 p = frame.T_base_camera.inverse() * Vec3(cloud.points_m.row(i));
      const double d = normal.dot(p) - distance_m;
      squares += d * d;
      if (along.dot(p) > end_at_m) beyond += d, ++count;
    }
    EXPECT_GT(count, 20);
    return Off{std::sqrt(squares / double(cloud.points_m.rows())), beyond / double(count)};
  };
  const Off raw = off(false), averaged = off(true);
  EXPECT_GT(std::abs(raw.at_the_end_m), 0.001);
  EXPECT_LT(std::abs(averaged.at_the_end_m), 0.5 * std::abs(raw.at_the_end_m));
  EXPECT_LT(averaged.rms_m, 0.25 * raw.rms_m);  // 49 pixels; at the edges fewer
  EXPECT_GT(averaged.rms_m, 0.1 * raw.rms_m);
}

DepthFrame see_sphere(const Vec3& centre_m, double radius_m) {
  DepthFrame frame = empty_frame();
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 160; ++column) {
      const Vec3 ray = unproject(frame.camera, Vec2(column, row))->normalized();
      const double along = ray.dot(centre_m), under = along * along - centre_m.squaredNorm() + radius_m * radius_m;
      if (under > 0) frame.depth_m(row, column) = float((along - std::sqrt(under)) * ray.z());
    }
  return frame;
}

TEST(BackProjection, NormalsFollowASphere) {
  const Vec3 centre(0, 0, 0.8);
  const DepthFrame frame = see_sphere(centre, 0.2);
  Points normals_base;
  const RayCloud rays = back_project(frame, {}, &normals_base);
  ASSERT_GT(rays.range_m.size(), 2000);
  const Points points = to_point_cloud(rays).points_m;
  double worst = 0, mean = 0;
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const Vec3 exact = (Vec3(points.row(i)) - centre).normalized();
    const double angle = std::acos(std::min(1.0, exact.dot(Vec3(normals_base.row(i)))));
    worst = std::max(worst, angle);
    mean += angle / double(points.rows());
  }
  EXPECT_LT(mean, 0.02);
  EXPECT_LT(worst, 0.5);
}

// Errors of one sign would count more than those of the other: most of all at the outline, where a pixel tips its own plane.
TEST(BackProjection, APixelsWeightDoesNotKnowItsOwnNoise) {
  DepthFrame frame = see_sphere(Vec3(0, 0, 0.8), 0.2);
  frame.noise = {"realsense_d435", NAN, 0};
  std::mt19937 random(5);
  std::normal_distribution<float> noise(0, 0.002F);
  for (Index i = 0; i < frame.depth_m.size(); ++i)
    if (frame.depth_m.data()[i] > 0) frame.depth_m.data()[i] += noise(random);
  const RayCloud before = back_project(frame);
  const auto sigma_of = [](const RayCloud& rays, int row, int column) -> std::optional<double> {
    for (Index i = 0; i < rays.pixel.rows(); ++i)
      if (rays.pixel(i, 0) == column && rays.pixel(i, 1) == row) return rays.sigma_m(i);
    return std::nullopt;
  };
  int checked = 0;
  for (Index i = 0; i < before.pixel.rows(); i += 37) {
    const int column = before.pixel(i, 0), row = before.pixel(i, 1);
    for (const float error_m : {-0.002F, 0.002F}) {
      DepthFrame other = frame;
      other.depth_m(row, column) += error_m;
      const auto sigma_m = sigma_of(back_project(other), row, column);
      if (!sigma_m) continue;  // an edge to its neighbours then
      EXPECT_NEAR(*sigma_m, before.sigma_m(i), 1e-9 * before.sigma_m(i)) << row << " " << column;
      ++checked;
    }
  }
  EXPECT_GT(checked, 100);
}

TEST(BackProjection, FlyingPixelsAtAStepAreRemovedAndNothingElse) {
  DepthFrame frame = empty_frame();
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> mixture(0.1, 0.9);
  std::normal_distribution<double> noise(0, 0.002);
  int flying = 0;
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 160; ++column) {
      double z = column < 80 ? 0.6 : 0.8;
      if (column == 80) z = 0.6 + 0.2 * mixture(generator), ++flying;
      frame.depth_m(row, column) = float(z + noise(generator));
    }
  const MaskImage invalid = invalid_pixels(frame);
  int removed_flying = 0, removed_else = 0;
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 160; ++column) {
      if (column == 80)
        removed_flying += invalid(row, column);
      else if (column < 79 || column > 81)
        removed_else += invalid(row, column);
    }
  EXPECT_EQ(removed_flying, flying);
  EXPECT_LT(removed_else, 20);  // of 18 840; the tail of the noise beyond 4 sigma
}

TEST(BackProjection, SteepSurfaceIsNoEdge) {
  const double incidence = 0.85;  // on the axis; 1.37 at the border of the image
  const DepthFrame frame = see_plane(Vec3(std::sin(incidence), 0, -std::cos(incidence)), -0.25);
  EXPECT_EQ(invalid_pixels(frame).cast<int>().sum(), 0);
}

TEST(BackProjection, MaskRangeStrideAndGrazingAngle) {
  DepthFrame frame = see_plane(-Vec3::UnitZ(), -0.7);
  frame.mask = MaskImage::Zero(120, 160);
  frame.mask.block(10, 20, 30, 40).setOnes();
  frame.depth_m(100, 100) = 0;
  frame.depth_m(101, 100) = std::nanf("");
  frame.depth_m(102, 100) = 20;
  const RayCloud rays = back_project(frame);
  // The pixel of 20 m is out of range, thus missing and no edge.
  EXPECT_EQ(rays.range_m.size(), 120 * 160 - 30 * 40 - 3);
  for (Eigen::Index i = 0; i < rays.pixel.rows(); ++i) EXPECT_EQ(frame.mask(rays.pixel(i, 1), rays.pixel(i, 0)), 0);

  BackProjectionOptions every_fourth;
  every_fourth.stride_px = 4;
  EXPECT_EQ(back_project(see_plane(-Vec3::UnitZ(), -0.7), every_fourth).range_m.size(), 30 * 40);

  BackProjectionOptions frontal;
  frontal.max_incidence_rad = 0.5;
  EXPECT_EQ(back_project(see_plane(Vec3(std::sin(1.1), 0, -std::cos(1.1)), -0.5), frontal).range_m.size() > 0, false)
      << "all of the image is seen at more than 28 degrees";
}

TEST(BackProjection, MaskDoesNotHideEdges) {
  DepthFrame frame = see_plane(-Vec3::UnitZ(), -0.7);
  frame.mask = MaskImage::Zero(120, 160);
  frame.depth_m.block(40, 40, 20, 20).setConstant(0.4F);  // the robot, known and masked
  frame.mask.block(40, 40, 20, 20).setOnes();
  const MaskImage invalid = invalid_pixels(frame);
  EXPECT_EQ(invalid(39, 50), 1) << "the pixel beside the robot may mix both";
  EXPECT_EQ(invalid(37, 50), 0);
}

TEST(BackProjection, SigmaFollowsTheNoiseModel) {
  DepthFrame frame = see_plane(-Vec3::UnitZ(), -1.2);
  frame.noise = {"kinect_v1", NAN, 0};
  const RayCloud rays = back_project(frame);
  for (Eigen::Index i = 0; i < rays.range_m.size(); i += 101) {
    const double cosine = 1.2 / rays.range_m(i);
    const DepthNoiseInput at{1.2, std::acos(cosine), 140};
    const double axial_m = depth_noise_model("kinect_v1").axial_sigma_m(at);
    // A sample that stands beside the pixel's centre is off by the slope times that distance.
    const double sideways_m = depth_noise_model("kinect_v1").lateral_sigma_px(at) * 1.2 / 140;
    EXPECT_NEAR(rays.sigma_m(i), std::hypot(axial_m, sideways_m * std::tan(std::acos(cosine))) / cosine, 1e-7);
  }
}

TEST(BackProjection, BadInputIsNamed) {
  DepthFrame frame = empty_frame();
  frame.depth_m.resize(100, 160);
  EXPECT_THROW(back_project(frame), Error);
  frame = empty_frame();
  frame.mask = MaskImage::Zero(3, 3);
  EXPECT_THROW(back_project(frame), Error);
  frame = empty_frame();
  frame.noise = {};
  EXPECT_THROW(back_project(frame), Error);

  const auto refused = [](auto change) { return refuses([](const auto& o) { check(o); }, BackProjectionOptions{}, change); };
  using O = BackProjectionOptions;
  EXPECT_FALSE(refused([](O&) {}));
  EXPECT_TRUE(refused([](O& o) { o.min_depth_m = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.max_depth_m = 0.01; }));
  EXPECT_TRUE(refused([](O& o) { o.stride_px = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.edge_sigmas = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.edge_incidence_rad = 1.6; }));
  EXPECT_TRUE(refused([](O& o) { o.edge_margin_px = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.normal_radius_px = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.min_normal_pixels = 2; }));
  EXPECT_TRUE(refused([](O& o) { o.max_incidence_rad = NAN; }));
}

}  // namespace
}  // namespace palpate::sensing::back_projection_test
