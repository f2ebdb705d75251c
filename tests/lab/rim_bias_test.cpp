// label: unit
// SPDX-License-Identifier: Apache-2.0
// Rays that the fit believes are right on average: what survives the removal of depth edges at the rim of a round object is a
// choice that noise has a part in, and thousands of rays that err by a tenth of a standard deviation move nu by one.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/built_in.hpp"
#include "palpate/lab/robot.hpp"
#include "palpate/sensing/back_projection.hpp"
#include "palpate/sensing/observe.hpp"

namespace palpate::lab {
namespace {

struct Mean {
  double sum = 0;
  int count = 0;
  double value() const { return sum / std::max(1, count); }
};

struct Errors {
  std::array<Mean, 18> by_angle;  ///< over their standard deviations, by the angle between ray and normal in steps of 5 degrees
  double trusted_deg = 0;
};

Errors errors_of(const char* sensor) {
  ObjectOptions ball;
  ball.seed = 1;
  ball.material = "linear";
  ball.tetrahedra = 1000;
  LabOptions options;
  options.seed = 1;
  options.depth = depth_sensor(sensor);
  options.camera_std_m = options.camera_std_rad = 0;
  LabRobot robot(options, make_object("ball", ball));
  const geometry::TriangleTree tree(robot.object().surface);
  Environment environment;
  environment.planes = robot.scene().environment.planes;
  Errors errors;
  for (int image = 0; image < 12; ++image) {
    const DepthFrame frame = robot.take_depth_image();
    const RayCloud rays = sensing::observe(frame, environment, {});
    errors.trusted_deg = sensing::trusted_incidence_rad(frame, rays.range_m.mean()) * 180 / M_PI;
    for (Index i = 0; i < rays.range_m.size(); ++i) {
      const Vec3 direction = rays.directions.row(i);
      const auto hit = tree.cast(rays.origins_m.row(i), direction);
      if (!hit) continue;
      const auto corner = [&](int k) { return Vec3(tree.mesh().vertices_m.row(tree.mesh().triangles(hit->triangle, k))); };
      const Vec3 normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
      const double error = (rays.range_m(i) - hit->range_m) / rays.sigma_m(i);
      if (std::abs(error) > 4.685) continue;  // the fit's loss leaves it out
      Mean& mean = errors.by_angle[std::size_t(std::acos(std::min(1.0, -normal.dot(direction))) * 36 / M_PI)];
      mean.sum += error;
      ++mean.count;
    }
  }
  return errors;
}

class RimBias : public testing::TestWithParam<const char*> {};

TEST_P(RimBias, RaysThatCountAreRightOnAverage) {
  const auto [errors, trusted_deg] = errors_of(GetParam());
  EXPECT_GT(trusted_deg, 64);
  EXPECT_LT(trusted_deg, 76);
  for (std::size_t bin = 2; 5 * (bin + 1) <= trusted_deg + 0.1; ++bin) {
    ASSERT_GT(errors[bin].count, 3000) << bin;
    EXPECT_NEAR(errors[bin].value(), 0, 4 / std::sqrt(double(errors[bin].count))) << 5 * bin << " degrees and more";
  }
  EXPECT_LT(errors[15].value(), -0.05) << "75 to 80 degrees: were they right, there would be no need to leave them out";
}

INSTANTIATE_TEST_SUITE_P(Sensors, RimBias, testing::Values("realsense_d435", "kinect_v1"),
                         [](const auto& sensor) { return std::string(sensor.param); });

}  // namespace
}  // namespace palpate::lab
