// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/back_projection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/depth_edges.hpp"
#include "palpate/sensing/depth_noise.hpp"
#include "palpate/sensing/plane_fit.hpp"

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

Points normals(const DepthFrame& frame, const MaskImage& invalid, const BackProjectionOptions& options) {
  check(options);
  check_frame(frame);
  const Points directions = pixel_directions(frame.camera);
  Points result = Points::Constant(directions.rows(), 3, not_a_number);
  const PlaneFitter fit(frame, invalid, options, directions);
  for (int row = 0; row < invalid.rows(); ++row)
    for (int column = 0; column < invalid.cols(); ++column)
      if (!invalid(row, column)) result.row(Eigen::Index(row) * invalid.cols() + column) = fit.at(row, column).with_pixel.normal;
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
  const PlaneFitter fit(frame, invalid, options, directions);
  const DepthSigma sigma(frame.noise, frame.camera.fx_px);
  const double min_cosine = std::cos(options.max_incidence_rad);

  struct Hit {
    int row, column;
    Vec3 direction, normal;  // camera frame, unit length
    double range_m, sigma_m;
  };
  std::vector<Hit> hits;
  const double rounding_m = depth_step_m(frame.depth_m) / std::sqrt(12.0);
  for (int row = 0; row < invalid.rows(); row += options.stride_px)
    for (int column = 0; column < invalid.cols(); column += options.stride_px) {
      if (invalid(row, column)) continue;
      const auto [plane, of_neighbours] = fit.at(row, column);
      const FittedPlane& judge = options.blind_to_own_noise ? of_neighbours : plane;
      if (!plane.found() || !judge.found()) continue;
      const Vec3 ray = directions.row(Eigen::Index(row) * invalid.cols() + column);
      const double stretch = ray.norm();  // range = stretch * depth
      const double cosine = std::min(1.0, -judge.normal.dot(ray) / stretch);
      if (cosine < min_cosine) continue;
      const double at_m = options.blind_to_own_noise ? judge.depth_m : double(frame.depth_m(row, column));
      const double sigma_m = sigma.at(at_m, std::tan(std::acos(cosine)), rounding_m);
      const double depth_m = options.smooth ? plane.depth_m : frame.depth_m(row, column);
      hits.push_back({row, column, ray / stretch, plane.normal, depth_m * stretch, sigma_m * stretch});
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
