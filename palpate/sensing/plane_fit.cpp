// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/plane_fit.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

namespace palpate::sensing {

PlaneFitter::PlaneFitter(const DepthFrame& frame, const MaskImage& invalid, const BackProjectionOptions& options,
                         const Points& directions)
    : frame_(frame), invalid_(invalid), options_(options), directions_(directions), sigma_(frame.noise, frame.camera.fx_px) {}

FittedPlanes PlaneFitter::at(int row, int column) const {
  const int rows = int(invalid_.rows()), columns = int(invalid_.cols()), radius = options_.normal_radius_px;
  const Vec3 ray = directions_.row(Index(row) * columns + column);
  FittedPlanes planes;
  if (!ray.allFinite()) return planes;
  const double z0 = options_.blind_to_own_noise ? around_m(row, column) : double(frame_.depth_m(row, column));
  const double noise_gate = options_.edge_sigmas * std::sqrt(2.0) * sigma_.at(z0);
  const double slope = std::tan(options_.edge_incidence_rad) * z0 / std::min(frame_.camera.fx_px, frame_.camera.fy_px);
  Mat3 normal_matrix = Mat3::Zero();
  Vec3 right_hand_side = Vec3::Zero();
  int count = 0;
  for (int r = std::max(0, row - radius); r <= std::min(rows - 1, row + radius); ++r)
    for (int c = std::max(0, column - radius); c <= std::min(columns - 1, column + radius); ++c) {
      if (invalid_(r, c)) continue;
      const double z = frame_.depth_m(r, c);
      const double pixels = std::max(std::abs(r - row), std::abs(c - column));
      if (std::abs(z - z0) > noise_gate + slope * pixels && pixels > 0) continue;
      const auto direction = directions_.row(Index(r) * columns + c);
      // Centred on the pixel: the matrix stays well conditioned for long focal lengths.
      const Vec3 base((direction.x() - ray.x()), (direction.y() - ray.y()), 1.0);
      if (!base.allFinite()) continue;
      normal_matrix += base * base.transpose();
      right_hand_side += base / z;
      ++count;
    }
  if (count >= options_.min_normal_pixels) planes.with_pixel = solved(normal_matrix, right_hand_side, count, ray);
  if (invalid_(row, column) == 0) {  // the pixel itself lies nothing aside
    normal_matrix(2, 2) -= 1;
    right_hand_side(2) -= 1 / double(frame_.depth_m(row, column));
    --count;
  }
  if (count >= options_.min_normal_pixels) planes.of_neighbours = solved(normal_matrix, right_hand_side, count, ray);
  return planes;
}

// Where the surface is, the pixel itself left out: on a steep one its own noise would decide which neighbours belong to it.
double PlaneFitter::around_m(int row, int column) const {
  std::vector<float> beside;
  beside.reserve(8);
  for (int r = std::max(0, row - 1); r <= std::min(int(invalid_.rows()) - 1, row + 1); ++r)
    for (int c = std::max(0, column - 1); c <= std::min(int(invalid_.cols()) - 1, column + 1); ++c)
      if (!invalid_(r, c) && (r != row || c != column)) beside.push_back(frame_.depth_m(r, c));
  if (beside.size() < 3) return frame_.depth_m(row, column);
  std::sort(beside.begin(), beside.end());
  return 0.5 * (double(beside[(beside.size() - 1) / 2]) + double(beside[beside.size() / 2]));
}

FittedPlane PlaneFitter::solved(const Mat3& normal_matrix, const Vec3& right_hand_side, int count, const Vec3& ray) const {
  FittedPlane fitted;
  const double spread = std::max(normal_matrix(0, 0), normal_matrix(1, 1)) / count;
  const Vec3 scale(1 / std::sqrt(spread), 1 / std::sqrt(spread), 1);  // x and y in units of the window
  const Mat3 scaled = scale.asDiagonal() * normal_matrix * scale.asDiagonal();
  if (!(spread > 0) || std::abs(scaled.determinant()) < 1e-3 * std::pow(count, 3)) return fitted;  // all in a line
  Vec3 plane = scale.asDiagonal() * scaled.inverse() * (scale.asDiagonal() * right_hand_side);
  const double inverse_depth = plane.z();
  plane.z() -= plane.x() * ray.x() + plane.y() * ray.y();  // undo the centring
  if (!(plane.norm() > 0)) return fitted;
  if (inverse_depth > 0) fitted.depth_m = 1 / inverse_depth;
  plane.normalize();
  fitted.normal = plane.dot(ray) > 0 ? Vec3(-plane) : plane;
  return fitted;
}

}  // namespace palpate::sensing
