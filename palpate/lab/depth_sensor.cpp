// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/depth_sensor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <string>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::lab {
namespace {

// White noise through a Gaussian kernel, scaled to unit variance: a field whose neighbours agree.
DepthImage correlated_field(int rows, int columns, double length_px, Random& random) {
  const int radius = std::max(1, int(std::ceil(3 * length_px / std::sqrt(2.0))));
  std::vector<double> kernel(std::size_t(2 * radius + 1));
  double energy = 0;
  for (int k = -radius; k <= radius; ++k) {
    const double w = std::exp(-double(k * k) / (length_px * length_px));  // its autocorrelation falls as exp(-d^2 / 2 l^2)
    kernel[std::size_t(k + radius)] = w;
    energy += w * w;
  }
  for (double& w : kernel) w /= std::sqrt(energy);
  DepthImage white(rows + 2 * radius, columns + 2 * radius);
  for (Eigen::Index i = 0; i < white.size(); ++i) white.data()[i] = float(random.normal());
  DepthImage half = DepthImage::Zero(rows + 2 * radius, columns);
  for (int k = 0; k <= 2 * radius; ++k) half += float(kernel[std::size_t(k)]) * white.middleCols(k, columns);
  DepthImage field = DepthImage::Zero(rows, columns);
  for (int k = 0; k <= 2 * radius; ++k) field += float(kernel[std::size_t(k)]) * half.middleRows(k, rows);
  return field;
}

constexpr double modulation_hz = 20e6;  // as in the noise model's table

Look look_of(const DepthSensorOptions& options, int label) {
  return std::size_t(label) < options.looks.size() ? options.looks[std::size_t(label)] : Look{};
}

// Every pixel's light is a phasor: amplitude from albedo, angle and distance, phase from the range. A share of the image's
// mean phasor, scattered in the lens, falls on all of them (Mure-Dubois and Huegli 2007).
DepthImage scattered(const PerfectView& view, const Camera& camera, const DepthSensorOptions& options) {
  const double phase_per_m = 4 * M_PI * modulation_hz / 299792458.0;
  const auto stretch = [&](Eigen::Index row, Eigen::Index column) {
    return std::sqrt(1 + std::pow((double(column) - camera.cx_px) / camera.fx_px, 2) +
                     std::pow((double(row) - camera.cy_px) / camera.fy_px, 2));
  };
  const auto phasor = [&](Eigen::Index row, Eigen::Index column) {
    const double z = view.depth_m(row, column);
    const double light = look_of(options, view.label(row, column)).albedo *
                         std::max(std::cos(double(view.incidence_rad(row, column))), 0.05) / (z * z);
    return std::polar(light, phase_per_m * z * stretch(row, column));
  };
  std::complex<double> mean = 0;
  for (Eigen::Index row = 0; row < view.depth_m.rows(); ++row)
    for (Eigen::Index column = 0; column < view.depth_m.cols(); ++column)
      if (view.depth_m(row, column) > 0) mean += phasor(row, column) / double(view.depth_m.size());
  DepthImage depth = view.depth_m;
  for (Eigen::Index row = 0; row < depth.rows(); ++row)
    for (Eigen::Index column = 0; column < depth.cols(); ++column) {
      if (!(depth(row, column) > 0)) continue;
      const std::complex<double> clean = phasor(row, column);
      // The change of phase is small: no ambiguity of the range.
      depth(row, column) += float(std::arg((clean + options.lens_scatter * mean) / clean) / phase_per_m / stretch(row, column));
    }
  return depth;
}

DepthSensorOptions of_model(const char* model) {
  DepthSensorOptions options;
  options.noise.model = model;
  return options;
}
DepthSensorOptions bumblebee() {
  DepthSensorOptions options = of_model("bumblebee_stereo");
  options.needs_texture = true;
  options.correlated_sigma_m = 0.0005;  // windows of matching overlap
  return options;
}
DepthSensorOptions time_of_flight() {
  DepthSensorOptions options = of_model("time_of_flight");
  options.lens_scatter = 0.01;
  options.depth_unit_m = 0;
  return options;
}

DepthSensorOptions azure_kinect() {
  DepthSensorOptions options = of_model("azure_kinect");
  options.bias_std_m = 0.0055;
  return options;
}

constexpr std::array<DepthSensor, 6> sensors{{
    {"realsense_d435", "noise of realsense_d435; flying pixels beside edges, depth in millimetres",
     [] { return of_model("realsense_d435"); }},
    {"kinect_v1", "noise of kinect_v1 (Nguyen et al. 2012), nothing beyond 80 degrees", [] { return of_model("kinect_v1"); }},
    {"bumblebee", "noise of bumblebee_stereo; passive: loses patches of surfaces without texture (Frank et al. 2010, section V: "
                  "unsatisfactory on uniform objects)", bumblebee},
    {"time_of_flight", "noise of time_of_flight (Lange and Seitz 2001) with albedo and ambient light; one per cent of the light "
                       "scattered in the lens (effect: Mure-Dubois and Huegli 2007)", time_of_flight},
    {"azure_kinect", "noise of azure_kinect; one offset of all depths, 11 mm at two standard deviations (hardware specification)", azure_kinect},
    {"realsense_l515", "noise of realsense_l515 (datasheet)", [] { return of_model("realsense_l515"); }},
}};

}  // namespace

std::span<const DepthSensor> depth_sensors() { return sensors; }

DepthSensorOptions depth_sensor(std::string_view name) {
  std::string names;
  for (const DepthSensor& row : sensors) {
    if (row.name == name) return row.options();
    names += (names.empty() ? "" : ", ") + std::string(row.name);
  }
  throw Error("is no depth sensor of the lab; there are: " + names, "depth sensor " + std::string(name));
}

double time_of_flight_sigma_m(double depth_m, double incidence_rad, const Look& look, double ambient_light) {
  const double electrons = 4e4 * look.albedo / 0.5;  // the model's 40 000 at 1 m are those of half albedo
  return sensing::time_of_flight_sigma_m(modulation_hz, electrons * std::max(std::cos(incidence_rad), 0.05) / (depth_m * depth_m),
                                         electrons * ambient_light, 0.99);
}

DepthNoise stated_noise(const DepthSensorOptions& options) {
  DepthNoise noise = options.noise;
  noise.shared_std_m = options.correlated_sigma_m;
  noise.bias_std_m = options.bias_std_m;
  return noise;
}

void check(const DepthSensorOptions& o) {
  const auto bad = [](const char* field, const char* rule) {
    throw Error(rule, std::string("DepthSensorOptions.") + field);
  };
  if (!(o.bias_std_m >= 0)) bad("bias_std_m", "must not be negative");
  if (!(o.correlated_sigma_m >= 0)) bad("correlated_sigma_m", "must not be negative");
  if (!(o.correlation_px >= 0.5 && o.correlation_px <= 200)) bad("correlation_px", "must be between 0.5 and 200");
  if (!(o.flying_pixel_share >= 0 && o.flying_pixel_share <= 1)) bad("flying_pixel_share", "must be between 0 and 1");
  if (!(o.dropout_incidence_rad > 0)) bad("dropout_incidence_rad", "must be positive");
  if (!(o.depth_unit_m >= 0)) bad("depth_unit_m", "must not be negative");
  if (!(o.lens_scatter >= 0 && o.lens_scatter < 1)) bad("lens_scatter", "must be in [0, 1)");
  if (!(o.ambient_light >= 0)) bad("ambient_light", "must not be negative");
  for (const Look& look : o.looks)
    if (!(look.albedo > 0 && look.albedo <= 1 && look.texture >= 0 && look.texture <= 1))
      bad("looks", "albedo must be in (0, 1], texture in [0, 1]");
  sensing::axial_sigma_m(o.noise, {});
}

DepthImage sense_depth(const PerfectView& view, const Camera& camera, const DepthSensorOptions& options, Random& random) {
  check(options);
  const int rows = int(view.depth_m.rows()), columns = int(view.depth_m.cols());
  DepthImage shared;
  if (options.correlated_sigma_m > 0) shared = correlated_field(rows, columns, options.correlation_px, random);
  DepthImage patches;  // standard normal, the same over a matching window
  if (options.needs_texture) patches = correlated_field(rows, columns, 6, random);
  const bool of_light = options.noise.model == "time_of_flight";
  const DepthImage lit = options.lens_scatter > 0 ? scattered(view, camera, options) : view.depth_m;
  auto* const lateral =
      options.noise.model == "constant" ? nullptr : sensing::depth_noise_model(options.noise.model).lateral_sigma_px;

  DepthImage seen = DepthImage::Zero(rows, columns);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      // Every pixel draws the same count of numbers, so that one pixel's fate does not change its neighbours' noise.
      const double flying = random.uniform(), mixture = random.uniform(), pick = random.uniform();
      const double shift_u = random.normal(), shift_v = random.normal(), axial = random.normal();
      const double clean = view.depth_m(row, column);
      if (!(clean > 0) || view.incidence_rad(row, column) > options.dropout_incidence_rad) continue;
      const Look look = look_of(options, view.label(row, column));
      // The share 1 - t of a normal field's values lies above its t-quantile.
      if (options.needs_texture && 0.5 * std::erfc(-patches(row, column) / std::sqrt(2.0)) >= look.texture) continue;
      double z = lit(row, column);

      // Neighbours on another surface: label differs or depth jumps by more than slope explains.
      double others[8];
      int other_count = 0;
      const double spacing = clean / camera.fx_px, slope = std::tan(std::min(1.45F, view.incidence_rad(row, column)));
      for (int r = std::max(0, row - 1); r <= std::min(rows - 1, row + 1); ++r)
        for (int c = std::max(0, column - 1); c <= std::min(columns - 1, column + 1); ++c) {
          const double other = view.depth_m(r, c);
          if (other > 0 && std::abs(other - clean) > 0.005 + 2 * slope * spacing) others[other_count++] = other;
        }
      if (other_count > 0) {
        if (flying < options.flying_pixel_share)
          z = mixture * z + (1 - mixture) * others[std::min(other_count - 1, int(pick * other_count))];
      } else if (options.lateral_jitter && lateral) {
        // The sample belongs to a point beside the pixel's centre: on a smooth surface that is its slope times the shift.
        const double sigma = lateral({clean, view.incidence_rad(row, column), camera.fx_px});
        const auto gradient = [&](double behind, double ahead) {
          return behind > 0 && ahead > 0 ? 0.5 * (ahead - behind) : 0.0;
        };
        const double along_u = column > 0 && column + 1 < columns
                                   ? gradient(view.depth_m(row, column - 1), view.depth_m(row, column + 1))
                                   : 0.0;
        const double along_v =
            row > 0 && row + 1 < rows ? gradient(view.depth_m(row - 1, column), view.depth_m(row + 1, column)) : 0.0;
        z += sigma * (shift_u * along_u + shift_v * along_v);
      }
      z += axial * (of_light ? time_of_flight_sigma_m(clean, view.incidence_rad(row, column), look, options.ambient_light)
                             : sensing::axial_sigma_m(options.noise, {clean, view.incidence_rad(row, column), camera.fx_px}));
      z += options.bias_m;
      if (shared.size() != 0) z += options.correlated_sigma_m * shared(row, column);
      if (options.depth_unit_m > 0) z = options.depth_unit_m * std::round(z / options.depth_unit_m);
      seen(row, column) = float(std::max(z, 0.0));
    }
  return seen;
}

}  // namespace palpate::lab
