// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/depth_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "palpate/core/error.hpp"

namespace palpate::sensing {
namespace {

double square(double x) { return x * x; }

// Past 80 degrees the published fits blow up and real sensors return nothing: hold the value there.
double grazing(double incidence_rad) {
  const double theta = std::min(std::abs(incidence_rad), 80.0 * M_PI / 180);
  return theta / (0.5 * M_PI - theta);
}

double kinect_v1_axial(const DepthNoiseInput& in) {
  const double theta = std::min(std::abs(in.incidence_rad), 80.0 * M_PI / 180);
  const double frontal = 0.0012 + 0.0019 * square(in.depth_m - 0.4);
  // The source gives the angular term for 60 degrees and more; below, its effect is under the frontal term's own error.
  return frontal + 0.0001 / std::sqrt(in.depth_m) * square(theta) / square(0.5 * M_PI - theta);
}
double kinect_v1_lateral(const DepthNoiseInput& in) { return 0.8 + 0.035 * grazing(in.incidence_rad); }

double d435_axial(const DepthNoiseInput& in) { return 0.00241809 + 0.00662547 * square(in.depth_m - 0.77199589); }
double d435_lateral(const DepthNoiseInput& in) { return 0.00220941 * in.focal_px; }

double d435_stereo_axial(const DepthNoiseInput& in) { return stereo_sigma_m(in.depth_m, in.focal_px, 0.050, 0.08); }
double bumblebee_axial(const DepthNoiseInput& in) { return stereo_sigma_m(in.depth_m, in.focal_px, 0.120, 0.1); }

double fotonic_axial(const DepthNoiseInput&) { return 0.0263; }
double fotonic_lateral(const DepthNoiseInput& in) { return 0.003163 * in.focal_px; }

// A per cent of the light is usual (lens_scatter.hpp), of an object half as bright as what stands about it two.
constexpr double flash_scatter = 0.02;

// A diffuse surface of half albedo that returns 40 000 electrons at 1 m and as much ambient light: 6 mm there.
double time_of_flight_axial(const DepthNoiseInput& in) {
  const double signal = 4e4 * std::max(std::cos(in.incidence_rad), 0.05) / square(in.depth_m);
  return time_of_flight_sigma_m(20e6, signal, 4e4, 0.99);
}

// At most 17 mm at the end of its range, 3.86 m; shot noise of a camera's own light grows with distance.
double azure_kinect_axial(const DepthNoiseInput& in) { return 0.017 / 3.86 * in.depth_m; }

double l515_axial(const DepthNoiseInput& in) { return 0.0025 + (0.0155 - 0.0025) / 8.0 * std::max(in.depth_m - 1.0, 0.0); }

constexpr std::array<DepthNoiseModel, 8> table{{
    {"kinect_v1",
     "Nguyen, Izadi, Lovell: Modeling Kinect Sensor Noise for Improved 3D Reconstruction and Tracking, 3DIMPVT 2012",
     kinect_v1_axial, kinect_v1_lateral},
    {"realsense_d435", "elevation_mapping, realsense_d435.yaml (ANYbotics, fitted by T. Miki): measured on a D435",
     d435_axial, d435_lateral},
    {"realsense_stereo",
     "z^2 s / (f B), Intel white paper on tuning D400 cameras: B = 50 mm, s = 0.08 px rms on a textured wall",
     d435_stereo_axial, nullptr},
    {"bumblebee_stereo", "z^2 s / (f B), passive stereo with B = 120 mm (Point Grey Bumblebee2), s = 0.1 px",
     bumblebee_axial, nullptr},
    {"fotonic_g45", "elevation_mapping, fotonic_g45.yaml (ANYbotics): constant", fotonic_axial, fotonic_lateral,
     flash_scatter},
    {"time_of_flight", "Lange and Seitz 2001 with 20 MHz and 40 000 electrons at 1 m: a PMD-like camera",
     time_of_flight_axial, nullptr, flash_scatter},
    {"azure_kinect",
     "Azure Kinect DK hardware specification: at most 17 mm up to 3.86 m (to 3.5 m confirmed by Tolgyessy et al., Sensors 21(2):413, "
     "2021), taken as proportional to distance",
     azure_kinect_axial, nullptr},
    {"realsense_l515",
     "Intel RealSense L515 datasheet, 95 % reflectivity, VGA: 2.5 mm at 1 m, 15.5 mm at 9 m, linear between", l515_axial,
     nullptr},
}};

}  // namespace

std::span<const DepthNoiseModel> depth_noise_models() { return table; }

const DepthNoiseModel& depth_noise_model(std::string_view name) {
  for (const DepthNoiseModel& row : table)
    if (row.name == name) return row;
  std::string names = "constant";
  for (const DepthNoiseModel& row : table) names += ", " + std::string(row.name);
  throw Error("unknown depth noise model '" + std::string(name) + "'; there are: " + names, "noise.model");
}

double axial_sigma_m(const DepthNoise& noise, const DepthNoiseInput& input) {
  const bool constant = noise.model == "constant";
  if (constant && !(noise.sigma_m > 0))
    throw Error("the model 'constant' needs a positive standard deviation in metres; give it or name a sensor",
                "noise.sigma_m");
  return std::hypot(constant ? noise.sigma_m : depth_noise_model(noise.model).axial_sigma_m(input), noise.shared_std_m);
}

DepthSigma::DepthSigma(const DepthNoise& noise, double focal_px)
    : constant_m_(noise.sigma_m), shared_m_(noise.shared_std_m), focal_px_(focal_px) {
  axial_sigma_m(noise, {1.0, 0.0, focal_px});  // throws when it cannot be told
  if (noise.model != "constant") model_ = &depth_noise_model(noise.model);
}

double DepthSigma::at(double depth_m, double slope, double rounding_m) const {
  const DepthNoiseInput input{depth_m, slope == 0 ? 0 : std::atan(std::abs(slope)), focal_px_};
  const double axial_m = std::hypot(model_ != nullptr ? model_->axial_sigma_m(input) : constant_m_, shared_m_);
  const bool sideways = slope != 0 && model_ != nullptr && model_->lateral_sigma_px != nullptr;
  return std::hypot(axial_m, sideways ? model_->lateral_sigma_px(input) * depth_m / focal_px_ * slope : 0, rounding_m);
}

double stereo_sigma_m(double depth_m, double focal_px, double baseline_m, double disparity_sigma_px) {
  return square(depth_m) * disparity_sigma_px / (focal_px * baseline_m);
}

double time_of_flight_sigma_m(double modulation_hz, double signal_electrons, double background_electrons, double contrast) {
  constexpr double speed_of_light_m_s = 299792458.0;
  return speed_of_light_m_s / (4 * std::sqrt(2.0) * M_PI * modulation_hz) *
         std::sqrt(signal_electrons + background_electrons) / (contrast * signal_electrons);
}

}  // namespace palpate::sensing
