// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <complex>

namespace palpate {

/// Light of the whole picture that the lens of a time-of-flight camera spreads over every pixel (Mure-Dubois and Huegli
/// 2007, Real-time scattering compensation for time-of-flight camera): a pixel measures the phase of its own light and of a
/// share of the picture's mean light together. Surfaces are taken to be diffuse and of one albedo; what that gets wrong is
/// mostly a factor, and the share is estimated.
struct LensScatter {
  double share_std = 0;                         ///< prior of the share, mean 0
  std::complex<double> mean_light;              ///< over all pixels; 1 is a surface at 1 m seen frontally
  static constexpr double phase_per_m = 0.838;  ///< of range, at 20 MHz: 4 pi f / c; matters only in pictures metres deep

  /// What is added to a range, metres a unit of share (small shares), with its derivatives.
  struct Error {
    double m = 0, per_range = 0, per_cosine = 0;
  };
  /// @param cosine  of the angle between ray and normal, positive
  Error error(double range_m, double cosine) const {
    const std::complex<double> apart = mean_light * std::polar(1.0, -phase_per_m * range_m);
    const double dimmer = range_m * range_m / cosine;  // than a surface at 1 m seen frontally
    const double m = dimmer * apart.imag() / phase_per_m;
    return {m, 2 * m / range_m - dimmer * apart.real(), -m / cosine};
  }
};

}  // namespace palpate
