// label: unit
// SPDX-License-Identifier: Apache-2.0
// The simulated sensor must show the figures that its noise model states.
#include "palpate/lab/depth_sensor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"
#include "palpate/sensing/depth_noise.hpp"
#include "refusals.hpp"
#include "sensing/small_camera.hpp"

namespace palpate::lab::depth_sensor_test {
namespace {

PerfectView wall(float depth_m, float incidence_rad = 0) {
  PerfectView view;
  view.depth_m = DepthImage::Constant(120, 160, depth_m);
  view.incidence_rad = DepthImage::Constant(120, 160, incidence_rad);
  view.label = MaskImage::Ones(120, 160);
  return view;
}

double spread(const DepthImage& seen, double mean_m) {
  return std::sqrt((seen.cast<double>().array() - mean_m).square().mean());
}

TEST(DepthSensor, AxialNoiseIsThatOfEveryModelAtEveryRange) {
  for (const auto& row : sensing::depth_noise_models())
    for (const float z : {0.4F, 0.8F, 1.5F}) {
      DepthSensorOptions options;
      options.noise.model = std::string(row.name);
      options.depth_unit_m = 0;
      Random random(11, std::uint64_t(z * 10));
      const double expected = row.axial_sigma_m({z, 0.3, 300});
      const DepthImage seen = sense_depth(wall(z, 0.3F), small_camera(), options, random);
      // 19 200 samples: the standard error of their spread is half a per cent.
      EXPECT_NEAR(spread(seen, z) / expected, 1, 0.02) << row.name << " at " << z;
      EXPECT_NEAR(seen.cast<double>().mean(), z, 4 * expected / std::sqrt(19200.0)) << row.name;
    }
}

// By hand from the paper, not from our row. Nguyen, Izadi, Lovell 2012: sigma = 1.2 mm + 1.9 mm (z - 0.4)^2, and from 60 degrees
// on also 0.1 mm z^-1/2 a^2 / (pi/2 - a)^2, whose last factor is 4 at 60 degrees and 25 at 75. The sensor rounds to millimetres.
TEST(DepthSensor, AKinectIsAsNoisyAsItsPaperSays) {
  struct Figure {
    double z_m, angle_deg, sigma_mm;
  };
  const Figure figures[] = {{1, 0, 1.884},  {1, 60, 1.884 + 0.1 * 4},           {1, 75, 1.884 + 0.1 * 25},
                            {2, 0, 6.064}, {2, 60, 6.064 + 0.1 * 4 / 1.41421}, {2, 75, 6.064 + 0.1 * 25 / 1.41421}};
  for (const Figure& one : figures) {
    Random random(31, std::uint64_t(one.angle_deg + one.z_m));
    const DepthImage seen =
        sense_depth(wall(float(one.z_m), float(one.angle_deg * M_PI / 180)), small_camera(), depth_sensor("kinect_v1"), random);
    EXPECT_NEAR(1e3 * spread(seen, one.z_m) / std::sqrt(one.sigma_mm * one.sigma_mm + 1.0 / 12), 1, 0.02)
        << one.z_m << " m, " << one.angle_deg << " degrees";
    // Khoshelham and Oude Elberink 2012, who measured others: half a pixel of disparity, 1.425e-5 z^2 in centimetres.
    const double khoshelham_mm = 10 * 1.425e-5 * std::pow(100 * one.z_m, 2);
    if (one.angle_deg == 0) {
      EXPECT_NEAR(one.sigma_mm / khoshelham_mm, 1, 0.35);
    }
  }
  Random random(31);
  EXPECT_EQ(sense_depth(wall(1, float(81 * M_PI / 180)), small_camera(), depth_sensor("kinect_v1"), random).maxCoeff(), 0)
      << "past 80 degrees the paper has nothing";
}

TEST(DepthSensor, EveryRowOfTheTableWorks) {
  for (const DepthSensor& row : depth_sensors()) {
    const DepthSensorOptions options = depth_sensor(row.name);
    EXPECT_NO_THROW(check(options)) << row.name;
    EXPECT_FALSE(row.source.empty());
    Random random(3);
    EXPECT_GT((sense_depth(wall(0.7F, 0.4F), small_camera(), options, random).array() > 0).count(), 19000) << row.name;
  }
  EXPECT_THROW(depth_sensor("eye"), Error);
}

TEST(DepthSensor, PassiveStereoLosesWhatHasNoTexture) {
  DepthSensorOptions options = depth_sensor("bumblebee");
  for (const double texture : {0.0, 0.3, 0.8, 1.0}) {
    options.looks = {Look{}, Look{0.5, texture}};
    double share = 0;
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
      Random random(seed);
      share += double((sense_depth(wall(0.7F), small_camera(), options, random).array() > 0).count()) / 19200 / 8;
    }
    // Patches of 6 pixels: some 170 independent ones an image.
    EXPECT_NEAR(share, texture, 0.06) << texture;
  }
}

// sigma = c / (4 sqrt(2) pi f) sqrt(A + B) / (K A): a quarter of the albedo takes the light of both to a quarter, twice the
// sigma.
TEST(DepthSensor, TimeOfFlightIsNoisierOnDarkThingsAndInBrightLight) {
  DepthSensorOptions options = depth_sensor("time_of_flight");
  options.lens_scatter = 0;
  const auto spread_of = [&](double albedo, double ambient) {
    options.looks = {Look{}, Look{albedo, 1}};
    options.ambient_light = ambient;
    Random random(5);
    return spread(sense_depth(wall(1.0F), small_camera(), options, random), 1.0);
  };
  const double usual = spread_of(0.5, 1);
  EXPECT_NEAR(usual / sensing::depth_noise_model("time_of_flight").axial_sigma_m({1.0, 0, 300}), 1, 0.02);
  EXPECT_NEAR(spread_of(0.125, 1) / usual, 2, 0.04);
  EXPECT_NEAR(spread_of(0.5, 7) / usual, 2, 0.04);  // sqrt(A + 7 A) over sqrt(A + A)
}

// A dark wall in front of a bright one: light scattered in the lens draws the dark one back, by what adding phasors says.
TEST(DepthSensor, LensScatterDrawsDarkThingsTowardsBrightOnes) {
  PerfectView view = wall(2.0F);
  view.depth_m.leftCols(40).setConstant(1.0F);
  view.label.leftCols(40).setConstant(2);
  DepthSensorOptions options = depth_sensor("time_of_flight");
  options.looks = {Look{}, Look{0.9, 1}, Look{0.05, 1}};
  options.flying_pixel_share = 0;
  const auto mean_near = [&](double scatter) {
    options.lens_scatter = scatter;
    Random random(9);
    const DepthImage seen = sense_depth(view, small_camera(), options, random);
    return double(seen.block(50, 15, 20, 15).mean());
  };
  const double moved = mean_near(0.02) - mean_near(0);
  EXPECT_GT(moved, 0.01);
  // At the middle of that block, with both walls seen almost along the axis: phases of 1 m and 2 m.
  const double k = 4 * M_PI * 20e6 / 299792458.0;
  double re = 0, im = 0;
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 160; ++column) {
      const double stretch = std::sqrt(1 + std::pow((column - 79.5) / 300, 2) + std::pow((row - 59.5) / 300, 2));
      const double z = column < 40 ? 1.0 : 2.0, light = (column < 40 ? 0.05 : 0.9) / (z * z) / 19200;
      re += light * std::cos(k * z * stretch);
      im += light * std::sin(k * z * stretch);
    }
  const double stretch = std::sqrt(1 + std::pow((22 - 79.5) / 300, 2));
  const double dark_re = 0.05 * std::cos(k * stretch), dark_im = 0.05 * std::sin(k * stretch);
  const double predicted = (std::atan2(dark_im + 0.02 * im, dark_re + 0.02 * re) - k * stretch) / k / stretch;
  EXPECT_NEAR(moved / predicted, 1, 0.03);
}

TEST(DepthSensor, CorrelatedPartHasItsVarianceAndLength) {
  DepthSensorOptions options;
  options.noise = {"constant", 1e-7, 0};
  options.correlated_sigma_m = 0.002;
  options.correlation_px = 5;
  options.depth_unit_m = 0;
  double variance = 0, near = 0, far = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    const Eigen::ArrayXXd e = sense_depth(wall(0.7F), small_camera(), options, random).cast<double>().array() - double(0.7F);
    variance += e.square().mean() / 20;
    near += (e.leftCols(155) * e.rightCols(155)).mean() / 20;  // 5 px apart: exp(-1/2)
    far += (e.leftCols(130) * e.rightCols(130)).mean() / 20;   // 30 px apart: nothing
  }
  EXPECT_NEAR(std::sqrt(variance), 0.002, 1e-4);
  EXPECT_NEAR(near / variance, std::exp(-0.5), 0.05);
  EXPECT_NEAR(far / variance, 0, 0.05);
}

TEST(DepthSensor, FlyingPixelsStandBetweenTheTwoSidesOfAnEdge) {
  PerfectView view = wall(1.0F);
  view.depth_m.leftCols(80).setConstant(0.6F);
  DepthSensorOptions options;
  options.noise = {"constant", 1e-4, 0};
  options.depth_unit_m = 0;
  Random random(3);
  const DepthImage seen = sense_depth(view, small_camera(), options, random);
  int elsewhere = 0;
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 160; ++column) {
      const float z = seen(row, column);
      const bool between = z > 0.602F && z < 0.998F;
      if (column != 79 && column != 80) elsewhere += between;
    }
  EXPECT_EQ(elsewhere, 0);
}

// No source states a share. What can be said is geometry: a circle of radius R crosses the squares of 8 R pixels (4 R upright and
// 4 R level lines of the grid), and light of both sides falls on these at least. The sensor's mix within 1.2 of that, whichever
// way the edge runs: a spot of light a little wider than the pixel.
TEST(DepthSensor, AboutAsManyPixelsFlyAsAnEdgeCrosses) {
  constexpr double radius_px = 40;
  PerfectView view = wall(1.0F);
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 160; ++column)
      if (std::hypot(row - 59.7, column - 79.2) < radius_px) view.depth_m(row, column) = 0.6F;
  DepthSensorOptions options = depth_sensor("realsense_d435");
  options.noise = {"constant", 1e-4, 0};
  options.depth_unit_m = 0;
  double flying = 0;
  constexpr int images = 30;
  for (std::uint64_t seed = 0; seed < images; ++seed) {
    Random random(seed);
    const DepthImage seen = sense_depth(view, small_camera(), options, random);
    flying += double((seen.array() > 0.602F && seen.array() < 0.998F).count()) / images;
  }
  // 19 200 draws: their share is known to a third of a per cent; 1 % of the mixtures are within noise of one side.
  EXPECT_NEAR(flying / (8 * radius_px), 1.2, 0.04);
}

// Whoever changes a sensor finds its source in the way.
TEST(DepthSensor, EveryRowStandsInTheTableOfSources) {
  const std::string text = io::read_file(PALPATE_SOURCE_DIR "/docs/lab.md");
  for (const DepthSensor& row : depth_sensors())
    EXPECT_NE(text.find("\n| `" + std::string(row.name) + "` | "), std::string::npos) << row.name;
}

// A pixel's sample belongs to a place beside its centre: on a slope that is an error of depth, and none in front of a wall.
TEST(DepthSensor, JitterAcrossIsSeenOnSlopes) {
  DepthSensorOptions options;
  options.noise.model = "realsense_d435";
  options.depth_unit_m = 0;
  PerfectView slope = wall(0.8F, 0.6F);
  for (int column = 0; column < 160; ++column) slope.depth_m.col(column).setConstant(0.8F + 0.002F * float(column));
  const auto spread_with = [&](bool jitter) {
    options.lateral_jitter = jitter;
    Random random(21);
    const DepthImage off = sense_depth(slope, small_camera(), options, random) - slope.depth_m;
    return std::sqrt(off.block(1, 1, 118, 158).cast<double>().array().square().mean());
  };
  const double across_px = 0.00220941 * small_camera().fx_px;
  const double axial_m = spread_with(false);
  EXPECT_NEAR(std::sqrt(std::pow(spread_with(true), 2) - axial_m * axial_m) / (across_px * 0.002), 1, 0.05);
}

// All depths of one sensor are off alike, and what it states says how far they may be.
TEST(DepthSensor, OneOffsetOfAllDepths) {
  DepthSensorOptions options = depth_sensor("azure_kinect");
  EXPECT_NEAR(stated_noise(options).bias_std_m, 0.0055, 1e-12);
  options.bias_m = 0.004;
  Random random(4);
  EXPECT_NEAR(sense_depth(wall(0.6F), small_camera(), options, random).cast<double>().mean(), 0.604, 1e-4);
}

TEST(DepthSensor, GrazingSurfacesGiveNothingAndDepthIsQuantised) {
  DepthSensorOptions options;
  Random random(5);
  EXPECT_EQ(sense_depth(wall(1, 1.45F), small_camera(), options, random).maxCoeff(), 0);
  const DepthImage seen = sense_depth(wall(1), small_camera(), options, random);
  for (Eigen::Index i = 0; i < seen.size(); i += 37) {
    const double units = double(seen.data()[i]) / 0.001;
    EXPECT_NEAR(units, std::round(units), 1e-3);
  }
}

TEST(DepthSensor, SameSeedSameImage) {
  const PerfectView view = wall(0.9F);
  Random a(9, 2), b(9, 2), c(9, 3);
  const DepthImage first = sense_depth(view, small_camera(), {}, a);
  EXPECT_EQ(first, sense_depth(view, small_camera(), {}, b));
  EXPECT_NE(first, sense_depth(view, small_camera(), {}, c));
}

TEST(DepthSensor, BadOptionsAreRefused) {
  const auto refused = [](auto change) { return refuses([](const auto& o) { check(o); }, DepthSensorOptions{}, change); };
  using O = DepthSensorOptions;
  EXPECT_FALSE(refused([](O&) {}));
  EXPECT_TRUE(refused([](O& o) { o.bias_std_m = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.correlated_sigma_m = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.correlation_px = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.flying_pixel_share = 1.1; }));
  EXPECT_TRUE(refused([](O& o) { o.dropout_incidence_rad = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.depth_unit_m = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.noise.model = "eye"; }));
}

}  // namespace
}  // namespace palpate::lab::depth_sensor_test
