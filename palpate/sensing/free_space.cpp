// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/free_space.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::sensing {
namespace {

/// The least of the values above 0 in a square of `reach` pixels to every side; 0 stays 0.
DepthImage least_around(const DepthImage& image, Eigen::Index reach) {
  constexpr float nothing = std::numeric_limits<float>::infinity();
  const DepthImage own = (image.array() > 0).select(image, DepthImage::Constant(image.rows(), image.cols(), nothing));
  DepthImage along = own, out = own;
  for (Eigen::Index r = 0; r < own.rows(); ++r)
    for (Eigen::Index c = 0; c < own.cols(); ++c) {
      const Eigen::Index first = std::max<Eigen::Index>(0, c - reach), last = std::min(own.cols() - 1, c + reach);
      along(r, c) = own.row(r).segment(first, last - first + 1).minCoeff();
    }
  for (Eigen::Index r = 0; r < own.rows(); ++r) {
    const Eigen::Index first = std::max<Eigen::Index>(0, r - reach), last = std::min(own.rows() - 1, r + reach);
    out.row(r) = along.middleRows(first, last - first + 1).colwise().minCoeff();
  }
  return (image.array() > 0).select(out, image);
}

/// Sums over squares of `reach` pixels to every side.
Eigen::MatrixXd sums_around(const Eigen::MatrixXd& image, Eigen::Index reach) {
  Eigen::MatrixXd to = Eigen::MatrixXd::Zero(image.rows() + 1, image.cols() + 1);  // sum of all above and to the left
  for (Eigen::Index r = 0; r < image.rows(); ++r)
    for (Eigen::Index c = 0; c < image.cols(); ++c) to(r + 1, c + 1) = image(r, c) + to(r, c + 1) + to(r + 1, c) - to(r, c);
  Eigen::MatrixXd out(image.rows(), image.cols());
  for (Eigen::Index r = 0; r < image.rows(); ++r)
    for (Eigen::Index c = 0; c < image.cols(); ++c) {
      const Eigen::Index top = std::max<Eigen::Index>(0, r - reach), bottom = std::min(image.rows(), r + reach + 1),
                         left = std::max<Eigen::Index>(0, c - reach), right = std::min(image.cols(), c + reach + 1);
      out(r, c) = to(bottom, right) - to(top, right) - to(bottom, left) + to(top, left);
    }
  return out;
}

/// Depth of the plane in each pixel that sees it, as far as its neighbours' mean can tell; 0 elsewhere.
/// @param sigma_m  of each depth; 0: there is none
DepthImage depth_of_seen(const Plane& plane, const DepthFrame& frame, const DepthImage& sigma_m, double sigmas) {
  constexpr Eigen::Index reach = 3;
  constexpr double noise_shared_by_px = 3;  // a side: neighbours of a stereo camera are matched by the same pixels
  const Points directions = pixel_directions(frame.camera);
  const Vec3 normal = frame.T_base_camera.linear().transpose() * plane.normal;
  const double below_m = plane.normal.dot(plane.point_m - frame.T_base_camera.translation());
  DepthImage plane_m = DepthImage::Zero(sigma_m.rows(), sigma_m.cols());
  Eigen::MatrixXd off_m = Eigen::MatrixXd::Zero(sigma_m.rows(), sigma_m.cols()), there = off_m;
  for (Eigen::Index r = 0; r < sigma_m.rows(); ++r)
    for (Eigen::Index c = 0; c < sigma_m.cols(); ++c) {
      const double z = below_m / normal.dot(directions.row(r * sigma_m.cols() + c).transpose());
      if (!(sigma_m(r, c) > 0) || !(z > 0) || !std::isfinite(z)) continue;
      plane_m(r, c) = static_cast<float>(z);
      off_m(r, c) = frame.depth_m(r, c) - z;
      there(r, c) = 1;
    }
  const Eigen::MatrixXd sum_m = sums_around(off_m, reach), count = sums_around(there, reach);
  for (Eigen::Index r = 0; r < plane_m.rows(); ++r)
    for (Eigen::Index c = 0; c < plane_m.cols(); ++c) {
      if (plane_m(r, c) == 0) continue;
      const double pose = std::hypot(frame.pose_std_m, double(plane_m(r, c)) * frame.pose_std_rad);
      const double of_mean = noise_shared_by_px * double(sigma_m(r, c)) / std::sqrt(count(r, c));
      if (!(std::abs(sum_m(r, c) / count(r, c)) < sigmas * std::hypot(of_mean, pose))) plane_m(r, c) = 0;
    }
  return plane_m;
}

}  // namespace

FreeSpace::FreeSpace(const std::vector<DepthFrame>& frames, const FreeSpaceOptions& options) {
  if (!(options.sigmas >= 0)) throw Error("must not be negative", "FreeSpaceOptions.sigmas");
  if (!(options.margin_m >= 0)) throw Error("must not be negative", "FreeSpaceOptions.margin_m");
  for (const DepthFrame& frame : frames) {
    check(frame.camera);
    const auto rows = frame.depth_m.rows(), columns = frame.depth_m.cols();
    if (rows != frame.camera.height_px || columns != frame.camera.width_px)
      throw Error("the depth image has another size than its camera", "view " + std::to_string(views_.size()));
    const bool masked = frame.mask.rows() == rows && frame.mask.cols() == columns;
    View view{frame.camera, frame.T_base_camera.inverse(), DepthImage::Zero(rows, columns)};
    DepthImage sigma_m = view.free_m;
    for (Eigen::Index r = 0; r < rows; ++r)
      for (Eigen::Index c = 0; c < columns; ++c) {
        const double z = frame.depth_m(r, c);
        if (!(z > 0) || !std::isfinite(z) || (masked && frame.mask(r, c))) continue;
        const double sigma = axial_sigma_m(frame.noise, {z, 0, frame.camera.fx_px});
        const double pose = std::hypot(frame.pose_std_m, z * frame.pose_std_rad);
        sigma_m(r, c) = static_cast<float>(sigma);
        view.free_m(r, c) = static_cast<float>(std::max(0.0, z - options.margin_m - options.sigmas * std::hypot(sigma, pose)));
      }
    if (options.support) {
      const DepthImage plane_m = depth_of_seen(*options.support, frame, sigma_m, options.sigmas);
      for (Eigen::Index k = 0; k < plane_m.size(); ++k) {
        const double z = plane_m.data()[k], pose = std::hypot(frame.pose_std_m, z * frame.pose_std_rad);
        float& free_m = view.free_m.data()[k];
        if (z > 0) free_m = std::max(free_m, static_cast<float>(z - options.margin_m - options.sigmas * pose));
      }
    }
    // The nearest of the neighbours counts, as far aside as the picture may be off, and one without data is asked for none.
    std::vector<float> depths;
    for (Eigen::Index k = 0; k < view.free_m.size(); ++k)
      if (view.free_m.data()[k] > 0) depths.push_back(view.free_m.data()[k]);
    if (depths.empty()) continue;
    const auto near = depths.begin() + std::ptrdiff_t(depths.size() / 100);  // a stray pixel before the camera does not count
    std::nth_element(depths.begin(), near, depths.end());
    const double aside_rad = options.sigmas * std::hypot(frame.pose_std_m / double(*near), frame.pose_std_rad);
    const double aside_px = std::max(1.0, std::ceil(std::max(frame.camera.fx_px, frame.camera.fy_px) * aside_rad));
    view.free_m = least_around(view.free_m, static_cast<Eigen::Index>(std::min(aside_px, double(std::max(rows, columns)))));
    views_.push_back(std::move(view));
  }
}

bool FreeSpace::operator()(const Vec3& point_base_m) const {
  for (const View& view : views_) {
    const Vec3 p = view.T_camera_base * point_base_m;
    const auto pixel = project(view.camera, p);
    if (!pixel) continue;
    const auto c = static_cast<Eigen::Index>(std::lround(pixel->x())), r = static_cast<Eigen::Index>(std::lround(pixel->y()));
    if (r < 0 || c < 0 || r >= view.free_m.rows() || c >= view.free_m.cols()) continue;
    if (p.z() < view.free_m(r, c)) return true;
  }
  return false;
}

}  // namespace palpate::sensing
