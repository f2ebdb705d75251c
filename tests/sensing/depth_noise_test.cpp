// label: contract
// SPDX-License-Identifier: Apache-2.0
// Every row of the table of depth noise models, and the figures that its source states.
#include "palpate/sensing/depth_noise.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "palpate/core/error.hpp"

namespace palpate::sensing::depth_noise_test {
namespace {

TEST(DepthNoise, EveryRowIsNamedSourcedAndSane) {
  std::set<std::string_view> names;
  for (const DepthNoiseModel& row : depth_noise_models()) {
    EXPECT_TRUE(names.insert(row.name).second) << row.name << " twice";
    EXPECT_NE(row.name, "constant");
    EXPECT_GT(row.source.size(), 10u) << row.name;
    for (const double z : {0.3, 0.6, 1.0, 1.5, 3.0}) {
      double last = 0;
      for (const double theta : {0.0, 0.5, 1.0, 1.3, 1.5, 1.57}) {
        const DepthNoiseInput input{z, theta, 525};
        const double sigma = row.axial_sigma_m(input);
        EXPECT_GT(sigma, 1e-5) << row.name << " at " << z;
        EXPECT_LT(sigma, 1.0) << row.name << " at " << z;
        EXPECT_GE(sigma, last) << row.name << ": noise falls at grazing angles";
        last = sigma;
        if (row.lateral_sigma_px) {
          EXPECT_GT(row.lateral_sigma_px(input), 0) << row.name;
        }
      }
      EXPECT_EQ(axial_sigma_m(DepthNoise{std::string(row.name), NAN, 0}, {z, 0.2, 525}), row.axial_sigma_m({z, 0.2, 525}));
    }
  }
}

TEST(DepthNoise, FiguresOfTheSources) {
  const auto sigma = [](const char* name, double z, double theta = 0) {
    return depth_noise_model(name).axial_sigma_m({z, theta, 525});
  };
  EXPECT_NEAR(sigma("kinect_v1", 0.4), 0.0012, 1e-12);
  EXPECT_NEAR(sigma("kinect_v1", 1.4), 0.0031, 1e-12);
  EXPECT_NEAR(sigma("kinect_v1", 1.0, M_PI / 3), 0.0012 + 0.0019 * 0.36 + 0.0001 * 4, 1e-12);  // theta / (pi/2 - theta) = 2
  EXPECT_NEAR(sigma("realsense_d435", 0.77199589), 0.00241809, 1e-12);
  EXPECT_NEAR(sigma("realsense_l515", 1.0), 0.0025, 1e-12);
  EXPECT_NEAR(sigma("realsense_l515", 9.0), 0.0155, 1e-12);
  EXPECT_NEAR(sigma("realsense_l515", 0.4), 0.0025, 1e-12);
  // The fit's figures at ranges that pushes are watched from, by hand: 0.00241809 + 0.00662547 (z - 0.77199589)^2.
  EXPECT_NEAR(sigma("realsense_d435", 0.5), 0.0029083, 1e-7);
  EXPECT_NEAR(sigma("realsense_d435", 1.5), 0.0059295, 1e-7);
  EXPECT_NEAR(sigma("fotonic_g45", 0.7), 0.0263, 1e-12);
  EXPECT_NEAR(sigma("azure_kinect", 3.86), 0.017, 1e-12);
  // A tenth of a pixel of 525 over a base of 120 mm: 1.6 mm at a metre, a quarter of that at half of it.
  EXPECT_NEAR(sigma("bumblebee_stereo", 1.0), 0.0015873, 1e-7);
  EXPECT_NEAR(sigma("bumblebee_stereo", 0.5), 0.00039683, 1e-8);
}

// Across, in pixels: 0.8 and 0.035 theta / (pi/2 - theta) (Nguyen et al., their figure 3); the other two in radians.
TEST(DepthNoise, FiguresAcross) {
  const auto sigma_px = [](const char* name, double theta) { return depth_noise_model(name).lateral_sigma_px({1.0, theta, 600}); };
  EXPECT_NEAR(sigma_px("kinect_v1", 0), 0.8, 1e-12);
  EXPECT_NEAR(sigma_px("kinect_v1", M_PI / 3), 0.87, 1e-12);
  EXPECT_NEAR(sigma_px("realsense_d435", 0.5), 1.32565, 1e-5);
  EXPECT_NEAR(sigma_px("fotonic_g45", 0.5), 1.8978, 1e-6);
}

TEST(DepthNoise, StereoLawIsTheDerivativeOfTheDisparity) {
  const double f = 424, b = 0.05, s = 0.08, z = 0.9;
  const double disparity = f * b / z, step = 1e-4;
  const double difference = (f * b / (disparity - step) - f * b / (disparity + step)) / (2 * step);
  EXPECT_NEAR(stereo_sigma_m(z, f, b, s), std::abs(difference) * s, 1e-9);
}

TEST(DepthNoise, TimeOfFlightGrowsWithAmbientLightAndFallsWithSignal) {
  EXPECT_NEAR(time_of_flight_sigma_m(20e6, 4e4, 4e4, 0.99), 0.0060, 0.0001);
  EXPECT_NEAR(time_of_flight_sigma_m(20e6, 4e4, 0, 1) / time_of_flight_sigma_m(20e6, 1e4, 0, 1), 0.5, 1e-12);
  EXPECT_GT(time_of_flight_sigma_m(20e6, 4e4, 8e4, 0.99), time_of_flight_sigma_m(20e6, 4e4, 4e4, 0.99));
}

TEST(DepthNoise, ConstantNeedsAFigureAndUnknownNamesAreListed) {
  EXPECT_DOUBLE_EQ(axial_sigma_m(DepthNoise{"constant", 0.002, 0}, {}), 0.002);
  EXPECT_THROW(axial_sigma_m(DepthNoise{}, {}), Error);
  EXPECT_THROW(axial_sigma_m(DepthNoise{"constant", 0.0, 0}, {}), Error);
  try {
    axial_sigma_m(DepthNoise{"kinect", NAN, 0}, {});
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("kinect_v1"), std::string::npos);
  }
}

}  // namespace
}  // namespace palpate::sensing::depth_noise_test
