// SPDX-License-Identifier: Apache-2.0
// Standard deviation of depth sensors: one row of a table each, with its source.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

/// What a pixel's noise depends on.
struct DepthNoiseInput {
  double depth_m = 1;        ///< along the optical axis
  double incidence_rad = 0;  ///< between the ray and the surface normal; 0 = seen frontally
  double focal_px = 525;     ///< of the camera that measured
};

struct DepthNoiseModel {
  std::string_view name;
  std::string_view source;
  double (*axial_sigma_m)(const DepthNoiseInput&);     ///< along the optical axis
  double (*lateral_sigma_px)(const DepthNoiseInput&);  ///< across, in pixels; nullptr = the source states none
  double lens_scatter_std = 0;  ///< prior of the share of the picture's light that falls on every pixel (lens_scatter.hpp)
};

/// The table that --help, the docs and the contract test loop over. `constant` is not in it: it has no figures of its own.
std::span<const DepthNoiseModel> depth_noise_models();

/// Row of the table. @throws Error listing the names when there is none of that name.
const DepthNoiseModel& depth_noise_model(std::string_view name);

/// Standard deviation of one depth along the optical axis.
/// @throws Error when `constant` has no positive sigma_m, or for an unknown model.
double axial_sigma_m(const DepthNoise& noise, const DepthNoiseInput& input);

/// Noise of one camera's depths, its model looked up once.
class DepthSigma {
 public:
  /// @throws Error as axial_sigma_m does.
  DepthSigma(const DepthNoise& noise, double focal_px);
  /// Standard deviation along the optical axis, m, of a depth on a surface that falls by `slope` (metres of depth a metre aside).
  /// A sample that belongs to a point beside the pixel's centre is off by the slope times that distance. What depths are rounded
  /// by is added in squares.
  double at(double depth_m, double slope = 0, double rounding_m = 0) const;

 private:
  double constant_m_ = 0, shared_m_ = 0, focal_px_ = 0;
  const DepthNoiseModel* model_ = nullptr;  // nullptr: constant
};

/// Stereo law: sigma_z = z^2 s / (f B) for a disparity error of `disparity_sigma_px`.
double stereo_sigma_m(double depth_m, double focal_px, double baseline_m, double disparity_sigma_px);

/// Phase noise of a time-of-flight pixel: sigma = c / (4 sqrt(2) pi f_mod) sqrt(A + B) / (contrast A), with A signal and B
/// background electrons (Lange and Seitz 2001, IEEE J. Quantum Electronics 37(3), eq. 12).
double time_of_flight_sigma_m(double modulation_hz, double signal_electrons, double background_electrons, double contrast);

}  // namespace palpate::sensing
