// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/perspective_grid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "palpate/geometry/watertight_ray.hpp"

namespace palpate::geometry {
namespace {

constexpr double least_cosine = 0.2;     // between the axis and the way to a vertex: beyond it slopes tell directions badly
constexpr double cells_per_triangle = 2;
constexpr double most_cells = 1 << 20;
constexpr double finest = 1e8;   // cells a unit of slope
constexpr double margin = 1e-6;  // cells: far more than rounding moves a vertex or a ray by, of the finest too
constexpr float lower = 1 - 1e-6F, higher = 1 + 1e-6F;

float to_float(double positive) { return static_cast<float>(std::min(positive, 1e38)); }

Index cell_of(double at, Index cells) { return std::min(static_cast<Index>(std::max(at, 0.0)), cells - 1); }

}  // namespace

PerspectiveGrid::PerspectiveGrid(const Points& vertices_m, const Triangles& triangles, const Vec3& eye_m)
    : triangles_(triangles), from_eye_m_(vertices_m.rowwise() - eye_m.transpose()) {
  const Vec3 middle_m = 0.5 * (from_eye_m_.colwise().minCoeff() + from_eye_m_.colwise().maxCoeff());
  if (!middle_m.allFinite() || middle_m.isZero(0)) return;
  axis_ = middle_m.normalized();
  right_ = axis_.unitOrthogonal();
  down_ = axis_.cross(right_);
  const VectorX depth = from_eye_m_ * axis_;
  for (Index i = 0; i < depth.size(); ++i)
    if (!(depth(i) > 0 && depth(i) >= least_cosine * from_eye_m_.row(i).norm())) return;
  VectorX u = (from_eye_m_ * right_).cwiseQuotient(depth), v = (from_eye_m_ * down_).cwiseQuotient(depth);
  left_ = u.minCoeff();
  top_ = v.minCoeff();
  constexpr double no_less = 1e-100;
  const double width = std::max(u.maxCoeff() - left_, no_less), height = std::max(v.maxCoeff() - top_, no_less);
  const double cells = std::min(cells_per_triangle * static_cast<double>(triangles.rows()), most_cells);
  cells_per_slope_ = std::min({std::sqrt(cells / width / height), cells / width, cells / height, finest});
  columns_ = static_cast<Index>(width * cells_per_slope_) + 1;
  rows_ = static_cast<Index>(height * cells_per_slope_) + 1;
  u = (u.array() - left_) * cells_per_slope_;
  v = (v.array() - top_) * cells_per_slope_;
  in_view_ = true;
  sort_into_cells(u, v, depth);
}

void PerspectiveGrid::sort_into_cells(const VectorX& u, const VectorX& v, const VectorX& depth) {
  struct Span {
    Index cell, count, triangle;
  };
  std::vector<Span> spans;
  spans.reserve(static_cast<std::size_t>(5 * triangles_.rows()));
  nearest_.resize(static_cast<std::size_t>(triangles_.rows()));
  first_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1, 0);
  std::vector<double> from(static_cast<std::size_t>(rows_)), to(from.size());  // of a triangle in a row of cells
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const auto add = [&](Index triangle) {
    const std::array<Index, 3> corner{triangles_(triangle, 0), triangles_(triangle, 1), triangles_(triangle, 2)};
    const Index top = cell_of(std::min({v(corner[0]), v(corner[1]), v(corner[2])}) - margin, rows_);
    const Index bottom = cell_of(std::max({v(corner[0]), v(corner[1]), v(corner[2])}) + margin, rows_);
    std::fill(from.begin() + top, from.begin() + bottom + 1, infinity);
    std::fill(to.begin() + top, to.begin() + bottom + 1, -infinity);
    for (std::size_t k = 0; k < 3; ++k) {
      Index upper = corner[k], lower = corner[(k + 1) % 3];
      if (v(upper) > v(lower)) std::swap(upper, lower);
      const double high = v(upper), low = v(lower), per_row = high < low ? (u(lower) - u(upper)) / (low - high) : 0;
      const double level = high < low ? u(upper) : u(lower);  // the other end of one that lies along the rows is another edge's
      for (Index row = cell_of(high - margin, rows_), last = cell_of(low + margin, rows_); row <= last; ++row) {
        const double enters = level + (std::clamp(row - margin, high, low) - high) * per_row;
        const double leaves = level + (std::clamp(row + 1 + margin, high, low) - high) * per_row;
        from[row] = std::min(from[row], std::min(enters, leaves));
        to[row] = std::max(to[row], std::max(enters, leaves));
      }
    }
    for (Index row = top; row <= bottom; ++row) {
      const Index begin = cell_of(from[row] - margin, columns_), end = cell_of(to[row] + margin, columns_) + 1;
      spans.push_back({row * columns_ + begin, end - begin, triangle});
      for (Index c = row * columns_ + begin; c < row * columns_ + end; ++c) ++first_[static_cast<std::size_t>(c)];
    }
  };
  // What faces the eye is hit first as a rule, and spares the others.
  std::vector<Index> averted;
  for (Index t = 0; t < triangles_.rows(); ++t) {
    const Index a = triangles_(t, 0), b = triangles_(t, 1), c = triangles_(t, 2);
    nearest_[static_cast<std::size_t>(t)] = to_float(std::min({depth(a), depth(b), depth(c)})) * lower;
    if ((u(b) - u(a)) * (v(c) - v(a)) < (u(c) - u(a)) * (v(b) - v(a))) {
      add(t);
    } else {
      averted.push_back(t);
    }
  }
  for (Index t : averted) add(t);

  Index sum = 0;
  for (Index& count : first_) count = sum += count;
  entries_.resize(static_cast<std::size_t>(sum));
  for (auto span = spans.rbegin(); span != spans.rend(); ++span)  // from behind, so that the first comes first
    for (Index c = span->cell; c < span->cell + span->count; ++c)
      entries_[static_cast<std::size_t>(--first_[static_cast<std::size_t>(c)])] = span->triangle;
}

std::optional<RayHit> PerspectiveGrid::cast(const Vec3& direction) const {
  const double ahead = direction.dot(axis_);
  if (!(ahead > 0) || !direction.allFinite()) return std::nullopt;
  const double u = (direction.dot(right_) / ahead - left_) * cells_per_slope_, v = (direction.dot(down_) / ahead - top_) * cells_per_slope_;
  if (!(u > -margin && u < columns_ + margin && v > -margin && v < rows_ + margin)) return std::nullopt;
  const auto cell = static_cast<std::size_t>(cell_of(v, rows_) * columns_ + cell_of(u, columns_));
  const WatertightRay ray(direction);
  RayHit best;
  double range = std::numeric_limits<double>::infinity();
  float depth = std::numeric_limits<float>::infinity();  // of the hit, rounded up
  for (Index e = first_[cell]; e < first_[cell + 1]; ++e) {
    const Index triangle = entries_[static_cast<std::size_t>(e)];
    if (nearest_[static_cast<std::size_t>(triangle)] > depth) continue;
    const auto corner = [&](int k) { return from_eye_m_.data() + 3 * triangles_(triangle, k); };
    if (!ray.hit(corner(0), corner(1), corner(2), range, best)) continue;
    best.triangle = triangle;
    range = best.range_m;
    depth = to_float(range * ahead) * higher;
  }
  if (best.triangle < 0) return std::nullopt;
  return best;
}

}  // namespace palpate::geometry
