// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/depth_edges.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/depth_noise.hpp"
#include "palpate/sensing/plane_fit.hpp"

namespace palpate::sensing {
namespace {

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

class EdgeTest {
 public:
  EdgeTest(const DepthFrame& frame, const MaskImage& missing, const BackProjectionOptions& options)
      : frame_(frame),
        directions_(pixel_directions(frame.camera)),
        fit_(frame, missing, options, directions_),
        sigma_(frame.noise, frame.camera.fx_px),
        sigmas_(options.edge_sigmas * std::sqrt(2.0)),
        steepest_(std::tan(options.edge_incidence_rad)),
        blind_(options.blind_to_own_noise),
        spacing_(1 / std::min(frame.camera.fx_px, frame.camera.fy_px)) {}

  bool differ(int row, int column, int other_row, int other_column) const {
    const double a = frame_.depth_m(row, column), b = frame_.depth_m(other_row, other_column);
    const double near_m = std::min(a, b), most_m = steepest_ * spacing_ * near_m, jump_m = b - a;
    if (!blind_) return std::abs(jump_m) > allowed_m(near_m, 0);
    // Planes are fitted only where what they say can change the answer.
    if (std::abs(jump_m) <= allowed_m(near_m, 0) - most_m) return false;
    if (std::abs(jump_m) > allowed_m(near_m, steepest_) + most_m) return true;
    double fall_m = 0;
    int planes = 0;
    for (const auto& [r, c] : {std::pair{row, column}, std::pair{other_row, other_column}}) {
      const FittedPlane plane = fit_.at(r, c).of_neighbours;
      if (!plane.found()) continue;
      // Over what it is at the one ray, the depth of a plane at the other.
      const double here = plane.normal.dot(ray(row, column)), there = plane.normal.dot(ray(other_row, other_column));
      if (here * there <= 0) continue;
      fall_m += near_m * (here / there - 1);
      ++planes;
    }
    if (planes > 0) fall_m = std::clamp(fall_m / planes, -most_m, most_m);
    return std::abs(jump_m - fall_m) > allowed_m(near_m, fall_m / (spacing_ * near_m));
  }

 private:
  Vec3 ray(int row, int column) const { return directions_.row(Index(row) * frame_.depth_m.cols() + column); }
  double allowed_m(double depth_m, double slope) const {
    return std::hypot(sigmas_ * sigma_.at(depth_m, slope), steepest_ * spacing_ * depth_m);
  }

  const DepthFrame& frame_;
  Points directions_;
  PlaneFitter fit_;
  DepthSigma sigma_;
  double sigmas_, steepest_;
  bool blind_;
  double spacing_;  // of pixels, a metre of depth
};

}  // namespace

MaskImage depth_edges(const DepthFrame& frame, const MaskImage& missing, const BackProjectionOptions& options) {
  const int rows = int(missing.rows()), columns = int(missing.cols());
  MaskImage edge = MaskImage::Zero(rows, columns);
  const EdgeTest test(frame, missing, options);
  // What the mask takes away anyway is not asked about.
  const bool every = frame.mask.size() == 0 || options.edge_margin_px > 1;
  const auto matters = [&](int row, int column) { return every || frame.mask(row, column) == 0; };
  const auto compare = [&](int row, int column, int other_row, int other_column) {
    if (!matters(row, column) && !matters(other_row, other_column)) return;
    const bool here = !missing(row, column), there = !missing(other_row, other_column);
    if (here != there) {
      if (options.remove_hole_borders) edge(row, column) = edge(other_row, other_column) = 1;
      return;
    }
    if (here && test.differ(row, column, other_row, other_column)) edge(row, column) = edge(other_row, other_column) = 1;
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

}  // namespace palpate::sensing
