// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/back_projection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::sensing {
namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

void check_frame(const DepthFrame& frame) {
  check(frame.camera);
  const auto size = [](Eigen::Index columns, Eigen::Index rows) {
    return std::to_string(columns) + " x " + std::to_string(rows);
  };
  if (frame.depth_m.cols() != frame.camera.width_px || frame.depth_m.rows() != frame.camera.height_px)
    throw Error("image is " + size(frame.depth_m.cols(), frame.depth_m.rows()) + " pixels, its camera says " +
                    size(frame.camera.width_px, frame.camera.height_px),
                "depth_m");
  if (frame.mask.size() != 0 && (frame.mask.rows() != frame.depth_m.rows() || frame.mask.cols() != frame.depth_m.cols()))
    throw Error("is " + size(frame.mask.cols(), frame.mask.rows()) + " pixels, its image " +
                    size(frame.depth_m.cols(), frame.depth_m.rows()),
                "mask");
  axial_sigma_m(frame.noise, {1.0, 0.0, frame.camera.fx_px});  // throws when it cannot be told
}

bool usable(const DepthFrame& frame, const BackProjectionOptions& options, int row, int column) {
  const double z = frame.depth_m(row, column);
  if (!std::isfinite(z) || z < options.min_depth_m || z > options.max_depth_m) return false;
  return frame.mask.size() == 0 || frame.mask(row, column) == 0;
}

// Largest difference of depth over `pixels` pixels that one surface and the noise explain.
double allowed_jump_m(const DepthFrame& frame, const BackProjectionOptions& options, double z, double pixels) {
  const double sigma = axial_sigma_m(frame.noise, {z, 0.0, frame.camera.fx_px});
  const double spacing = pixels * z / std::min(frame.camera.fx_px, frame.camera.fy_px);
  // Slope and noise add up on a real surface, but a slope as steep as the limit hardly ever meets 4 sigma of noise.
  return std::hypot(options.edge_sigmas * std::sqrt(2.0) * sigma, std::tan(options.edge_incidence_rad) * spacing);
}

void grow(MaskImage& mask, int margin) {
  if (margin <= 0) return;
  const int rows = int(mask.rows()), columns = int(mask.cols());
  MaskImage wide = mask;
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column)
      if (mask(row, column))
        for (int c = std::max(0, column - margin); c <= std::min(columns - 1, column + margin); ++c) wide(row, c) = 1;
  mask = wide;
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column)
      if (wide(row, column))
        for (int r = std::max(0, row - margin); r <= std::min(rows - 1, row + margin); ++r) mask(r, column) = 1;
}

MaskImage depth_edges(const DepthFrame& frame, const MaskImage& missing, const BackProjectionOptions& options) {
  const int rows = int(missing.rows()), columns = int(missing.cols());
  MaskImage edge = MaskImage::Zero(rows, columns);
  const auto compare = [&](int row, int column, int other_row, int other_column) {
    const bool here = !missing(row, column), there = !missing(other_row, other_column);
    if (here != there) {
      if (options.remove_hole_borders) edge(row, column) = edge(other_row, other_column) = 1;
      return;
    }
    if (!here) return;
    const double a = frame.depth_m(row, column), b = frame.depth_m(other_row, other_column);
    if (std::abs(a - b) > allowed_jump_m(frame, options, std::min(a, b), 1.0))
      edge(row, column) = edge(other_row, other_column) = 1;
  };
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      if (column + 1 < columns) compare(row, column, row, column + 1);
      if (row + 1 < rows) compare(row, column, row + 1, column);
    }
  // The comparison marks both sides of an edge, which is a margin of one pixel already.
  grow(edge, options.edge_margin_px - 1);
  return edge;
}

struct NormalFitter {
  const DepthFrame& frame;
  const MaskImage& invalid;
  const BackProjectionOptions& options;
  const Points& directions;

  // Fits 1/z = a x + b y + c; the plane's normal is (a, b, c) up to length, whatever the plane.
  /// @param depth_m  if given: the plane's depth at the pixel
  Vec3 at(int row, int column, double* depth_m = nullptr) const {
    const Vec3 nothing = Vec3::Constant(not_a_number);
    const int rows = int(invalid.rows()), columns = int(invalid.cols()), radius = options.normal_radius_px;
    const double z0 = frame.depth_m(row, column);
    const Vec3 ray = directions.row(Eigen::Index(row) * columns + column);
    if (!ray.allFinite()) return nothing;
    const double noise_gate = options.edge_sigmas * std::sqrt(2.0) * axial_sigma_m(frame.noise, {z0, 0, frame.camera.fx_px});
    const double slope = std::tan(options.edge_incidence_rad) * z0 / std::min(frame.camera.fx_px, frame.camera.fy_px);
    Mat3 normal_matrix = Mat3::Zero();
    Vec3 right_hand_side = Vec3::Zero();
    int count = 0;
    for (int r = std::max(0, row - radius); r <= std::min(rows - 1, row + radius); ++r)
      for (int c = std::max(0, column - radius); c <= std::min(columns - 1, column + radius); ++c) {
        if (invalid(r, c)) continue;
        const double z = frame.depth_m(r, c);
        const double pixels = std::max(std::abs(r - row), std::abs(c - column));
        if (std::abs(z - z0) > noise_gate + slope * pixels) continue;
        const auto direction = directions.row(Eigen::Index(r) * columns + c);
        // Centred on the pixel: the matrix stays well conditioned for long focal lengths.
        const Vec3 base((direction.x() - ray.x()), (direction.y() - ray.y()), 1.0);
        if (!base.allFinite()) continue;
        normal_matrix += base * base.transpose();
        right_hand_side += base / z;
        ++count;
      }
    if (count < options.min_normal_pixels) return nothing;
    const double spread = std::max(normal_matrix(0, 0), normal_matrix(1, 1)) / count;
    Mat3 scaled = normal_matrix;  // x and y in units of the window
    const Vec3 scale(1 / std::sqrt(spread), 1 / std::sqrt(spread), 1);
    scaled = scale.asDiagonal() * scaled * scale.asDiagonal();
    if (!(spread > 0) || std::abs(scaled.determinant()) < 1e-3 * std::pow(count, 3)) return nothing;  // all in a line
    Vec3 plane = scale.asDiagonal() * scaled.inverse() * (scale.asDiagonal() * right_hand_side);
    if (depth_m && plane.z() > 0) *depth_m = 1 / plane.z();
    plane.z() -= plane.x() * ray.x() + plane.y() * ray.y();  // undo the centring
    if (!(plane.norm() > 0)) return nothing;
    plane.normalize();
    return plane.dot(ray) > 0 ? Vec3(-plane) : plane;
  }
};

}  // namespace

void check(const BackProjectionOptions& o) {
  const auto bad = [](const char* field, const char* rule) {
    throw Error(rule, std::string("BackProjectionOptions.") + field);
  };
  if (!(o.min_depth_m > 0)) bad("min_depth_m", "must be positive");
  if (!(o.max_depth_m > o.min_depth_m)) bad("max_depth_m", "must be above min_depth_m");
  if (o.stride_px < 1) bad("stride_px", "must be at least 1");
  if (!(o.edge_sigmas > 0)) bad("edge_sigmas", "must be positive");
  if (!(o.edge_incidence_rad > 0 && o.edge_incidence_rad < 0.5 * M_PI)) bad("edge_incidence_rad", "must be in (0, pi/2)");
  if (o.edge_margin_px < 1) bad("edge_margin_px", "must be at least 1 (or switch remove_edges off)");
  if (o.normal_radius_px < 1) bad("normal_radius_px", "must be at least 1");
  if (o.min_normal_pixels < 3) bad("min_normal_pixels", "must be at least 3: fewer points span no plane");
  if (!(o.max_incidence_rad > 0 && o.max_incidence_rad <= 0.5 * M_PI)) bad("max_incidence_rad", "must be in (0, pi/2]");
}

MaskImage invalid_pixels(const DepthFrame& frame, const BackProjectionOptions& options) {
  check(options);
  check_frame(frame);
  MaskImage missing(frame.depth_m.rows(), frame.depth_m.cols());
  // Masked pixels still tell where the edges are, so edges are found before the mask is applied.
  for (int row = 0; row < missing.rows(); ++row)
    for (int column = 0; column < missing.cols(); ++column) {
      const double z = frame.depth_m(row, column);
      missing(row, column) = !(std::isfinite(z) && z >= options.min_depth_m && z <= options.max_depth_m);
    }
  MaskImage invalid = missing;
  if (options.remove_edges) invalid = invalid.cwiseMax(depth_edges(frame, missing, options));
  for (int row = 0; row < missing.rows(); ++row)
    for (int column = 0; column < missing.cols(); ++column)
      if (!usable(frame, options, row, column)) invalid(row, column) = 1;
  return invalid;
}

double trusted_incidence_rad(const DepthFrame& frame, double depth_m, const BackProjectionOptions& options) {
  check(options);
  check_frame(frame);
  constexpr double sigmas = 1.5;
  const double allowed_m = allowed_jump_m(frame, options, depth_m, 1.0);
  const double spacing_m = depth_m / std::min(frame.camera.fx_px, frame.camera.fy_px);
  auto* const lateral = frame.noise.model == "constant" ? nullptr : depth_noise_model(frame.noise.model).lateral_sigma_px;
  constexpr int most_deg = 75, least_deg = 45;
  for (int degrees = most_deg; degrees > least_deg; --degrees) {
    const double incidence_rad = degrees * M_PI / 180, slope = std::tan(incidence_rad);
    const DepthNoiseInput at{depth_m, incidence_rad, frame.camera.fx_px};
    const double sideways_m = lateral != nullptr ? lateral(at) * depth_m / frame.camera.fx_px : 0;
    const double noise_m = std::sqrt(2.0) * std::hypot(axial_sigma_m(frame.noise, at), slope * sideways_m);
    if (slope * spacing_m + sigmas * noise_m < allowed_m) return incidence_rad;
  }
  return least_deg * M_PI / 180;
}

Points normals(const DepthFrame& frame, const MaskImage& invalid, const BackProjectionOptions& options) {
  check(options);
  check_frame(frame);
  const Points directions = pixel_directions(frame.camera);
  Points result = Points::Constant(directions.rows(), 3, not_a_number);
  const NormalFitter fit{frame, invalid, options, directions};
  for (int row = 0; row < invalid.rows(); ++row)
    for (int column = 0; column < invalid.cols(); ++column)
      if (!invalid(row, column)) result.row(Eigen::Index(row) * invalid.cols() + column) = fit.at(row, column);
  return result;
}

double depth_step_m(const DepthImage& depth_m) {
  constexpr std::size_t enough = 8;  // different depths
  std::vector<float> different;
  for (Eigen::Index i = 0; i < depth_m.size() && different.size() < enough; ++i) {
    const float z = depth_m.data()[i];
    if (std::isfinite(z) && z > 0 && std::find(different.begin(), different.end(), z) == different.end()) different.push_back(z);
  }
  if (different.size() < enough) return 0;
  for (const double step_m : {1e-3, 5e-4, 2.5e-4, 2e-4, 1.25e-4, 1e-4, 5e-5}) {
    const auto whole = [&](float z) {
      const double steps = static_cast<double>(z) / step_m;
      return !std::isfinite(z) || z <= 0 || std::abs(steps - std::round(steps)) < 0.01;  // a float's own rounding is below that up to 8 m
    };
    if (std::all_of(depth_m.data(), depth_m.data() + depth_m.size(), whole)) return step_m;
  }
  return 0;
}

RayCloud back_project(const DepthFrame& frame, const BackProjectionOptions& options, Points* normals_base) {
  const MaskImage invalid = invalid_pixels(frame, options);
  const Points directions = pixel_directions(frame.camera);
  const NormalFitter fit{frame, invalid, options, directions};
  const double min_cosine = std::cos(options.max_incidence_rad);

  struct Hit {
    int row, column;
    Vec3 direction, normal;  // camera frame, unit length
    double range_m, sigma_m;
  };
  std::vector<Hit> hits;
  const double rounding_m = depth_step_m(frame.depth_m) / std::sqrt(12.0);
  auto* const lateral = frame.noise.model == "constant" ? nullptr : depth_noise_model(frame.noise.model).lateral_sigma_px;
  for (int row = 0; row < invalid.rows(); row += options.stride_px)
    for (int column = 0; column < invalid.cols(); column += options.stride_px) {
      if (invalid(row, column)) continue;
      double smooth_m = frame.depth_m(row, column);
      const Vec3 normal = fit.at(row, column, &smooth_m);
      if (!normal.allFinite()) continue;
      const Vec3 ray = directions.row(Eigen::Index(row) * invalid.cols() + column);
      const double stretch = ray.norm();  // range = stretch * depth
      const double cosine = std::min(1.0, -normal.dot(ray) / stretch);
      if (cosine < min_cosine) continue;
      const double z = frame.depth_m(row, column);
      const double incidence_rad = std::acos(cosine);
      const DepthNoiseInput at{z, incidence_rad, frame.camera.fx_px};
      // A sample that belongs to a point beside the pixel's centre is off by the surface's slope times that distance.
      const double sideways_m = lateral != nullptr ? lateral(at) * z / frame.camera.fx_px : 0;
      const double sigma = std::hypot(axial_sigma_m(frame.noise, at), sideways_m * std::tan(incidence_rad), rounding_m);
      hits.push_back({row, column, ray / stretch, normal, (options.smooth ? smooth_m : z) * stretch, sigma * stretch});
    }

  const auto count = Eigen::Index(hits.size());
  RayCloud rays;
  rays.origins_m.resize(count, 3);
  rays.directions.resize(count, 3);
  rays.range_m.resize(count);
  rays.sigma_m.resize(count);
  rays.pixel.resize(count, 2);
  if (normals_base) normals_base->resize(count, 3);
  const Mat3 rotation = frame.T_base_camera.linear();
  for (Eigen::Index i = 0; i < count; ++i) {
    const Hit& hit = hits[std::size_t(i)];
    rays.origins_m.row(i) = frame.T_base_camera.translation();
    rays.directions.row(i) = rotation * hit.direction;
    rays.range_m(i) = hit.range_m;
    rays.sigma_m(i) = hit.sigma_m;
    rays.pixel.row(i) << hit.column, hit.row;
    if (normals_base) normals_base->row(i) = rotation * hit.normal;
  }
  return rays;
}

PointCloud to_point_cloud(const RayCloud& rays, const Points& normals_base) {
  if (normals_base.rows() != 0 && normals_base.rows() != rays.range_m.size())
    throw Error("must have one row a ray, or none", "normals_base");
  PointCloud cloud;
  cloud.points_m = rays.origins_m + rays.range_m.asDiagonal() * rays.directions;
  cloud.normals = normals_base;
  cloud.sigma_m = rays.sigma_m;
  return cloud;
}

}  // namespace palpate::sensing
