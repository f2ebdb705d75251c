// SPDX-License-Identifier: Apache-2.0
// Turns what a perfect camera would see into what a real one reports.
#pragma once

#include "palpate/core/recording.hpp"
#include "palpate/lab/random.hpp"
#include "palpate/lab/scene.hpp"

namespace palpate::lab {

struct DepthSensorOptions {
  DepthNoise noise{"realsense_d435", std::numeric_limits<double>::quiet_NaN(), 0.0};
  double correlated_sigma_m = 0.0;     ///< part of the noise that neighbours share, on top of the model's
  double correlation_px = 8.0;         ///< its correlation length (Gaussian kernel)
  bool lateral_jitter = true;          ///< where the model states a lateral noise
  double flying_pixel_share = 0.6;     ///< of the pixels beside a depth edge that report a mixture of both sides
  double dropout_incidence_rad = 1.4;  ///< no data at more grazing angles (80 degrees: Nguyen et al. 2012)
  double depth_unit_m = 0.001;         ///< quantisation of the reported depth; 0 = none
};

/// @throws Error naming the option that is out of range.
void check(const DepthSensorOptions& options);

/// Reported depth. Mixtures z = w z_near + (1 - w) z_far, w uniform, stand at depth edges; the axial noise follows the model
/// at the pixel's depth and incidence.
DepthImage sense_depth(const PerfectView& view, const Camera& camera, const DepthSensorOptions& options, Random& random);

}  // namespace palpate::lab
