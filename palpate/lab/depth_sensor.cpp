// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/depth_sensor.hpp"

#include <algorithm>
#include <cmath>
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

}  // namespace

void check(const DepthSensorOptions& o) {
  const auto bad = [](const char* field, const char* rule) {
    throw Error(rule, std::string("DepthSensorOptions.") + field);
  };
  if (!(o.correlated_sigma_m >= 0)) bad("correlated_sigma_m", "must not be negative");
  if (!(o.correlation_px >= 0.5 && o.correlation_px <= 200)) bad("correlation_px", "must be between 0.5 and 200");
  if (!(o.flying_pixel_share >= 0 && o.flying_pixel_share <= 1)) bad("flying_pixel_share", "must be between 0 and 1");
  if (!(o.dropout_incidence_rad > 0)) bad("dropout_incidence_rad", "must be positive");
  if (!(o.depth_unit_m >= 0)) bad("depth_unit_m", "must not be negative");
  sensing::axial_sigma_m(o.noise, {});
}

DepthImage sense_depth(const PerfectView& view, const Camera& camera, const DepthSensorOptions& options, Random& random) {
  check(options);
  const int rows = int(view.depth_m.rows()), columns = int(view.depth_m.cols());
  DepthImage shared;
  if (options.correlated_sigma_m > 0) shared = correlated_field(rows, columns, options.correlation_px, random);
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
      double z = clean;

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
          z = mixture * clean + (1 - mixture) * others[std::min(other_count - 1, int(pick * other_count))];
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
      z += axial * sensing::axial_sigma_m(options.noise, {clean, view.incidence_rad(row, column), camera.fx_px});
      if (shared.size() != 0) z += options.correlated_sigma_m * shared(row, column);
      if (options.depth_unit_m > 0) z = options.depth_unit_m * std::round(z / options.depth_unit_m);
      seen(row, column) = float(std::max(z, 0.0));
    }
  return seen;
}

}  // namespace palpate::lab
