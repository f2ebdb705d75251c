// SPDX-License-Identifier: Apache-2.0
// Turns what a perfect camera would see into what a real one reports.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/lab/look.hpp"
#include "palpate/lab/random.hpp"
#include "palpate/lab/scene.hpp"

namespace palpate::lab {

struct DepthSensorOptions {
  DepthNoise noise{"realsense_d435", std::numeric_limits<double>::quiet_NaN(), 0.0};
  double bias_std_m = 0.0;             ///< of one offset of all depths, as sensors of this kind have it
  double bias_m = 0.0;                 ///< as this one has it
  double correlated_sigma_m = 0.0;     ///< part of the noise that neighbours share, on top of the model's
  double correlation_px = 8.0;         ///< its correlation length (Gaussian kernel)
  bool lateral_jitter = true;          ///< where the model states a lateral noise
  double flying_pixel_share = 0.6;     ///< of the pixels on either side of a depth edge that report a mixture of both; no source
                                       ///< states one: as many as a spot of 1.2 pixels touches
  double dropout_incidence_rad = 1.4;  ///< no data at more grazing angles (80 degrees: Nguyen et al. 2012)
  double depth_unit_m = 0.001;         ///< quantisation of the reported depth; 0 = none
  bool needs_texture = false;          ///< passive stereo: on a surface of texture t the share 1 - t is lost, in patches
  double lens_scatter = 0;             ///< share of the image's mean light that falls on every pixel (time of flight only):
                                       ///< dark surfaces are drawn towards bright ones
  double ambient_light = 1;            ///< over what the time-of-flight model assumes
  std::vector<Look> looks;             ///< by PerfectView's label; missing ones are a Look{}
};

/// A sensor as it is bought: a row of a table with its source.
struct DepthSensor {
  std::string_view name;
  std::string_view source;
  DepthSensorOptions (*options)();
};

/// The table that --help and the tests loop over.
std::span<const DepthSensor> depth_sensors();

/// @throws Error listing the names when there is none of that name.
DepthSensorOptions depth_sensor(std::string_view name);

/// @throws Error naming the option that is out of range.
void check(const DepthSensorOptions& options);

/// What a recording says of the sensor's noise.
DepthNoise stated_noise(const DepthSensorOptions& options);

/// Axial noise of time of flight on a surface that is not of half albedo, or in other light than the model assumes.
double time_of_flight_sigma_m(double depth_m, double incidence_rad, const Look& look, double ambient_light);

/// Reported depth. Mixtures z = w z_near + (1 - w) z_far, w uniform, stand at depth edges; the axial noise follows the model
/// at the pixel's depth and incidence.
DepthImage sense_depth(const PerfectView& view, const Camera& camera, const DepthSensorOptions& options, Random& random);

}  // namespace palpate::lab
