// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/ray_bundle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "palpate/geometry/watertight_ray.hpp"

namespace palpate::geometry {
namespace {

constexpr double least_cosine = 0.2;  // between the axis and a ray or the way to a vertex: beyond it slopes tell directions badly
constexpr double rays_per_cell = 1;
constexpr double most_cells = 1 << 20;
constexpr double finest = 1e6;   // cells a unit of slope
constexpr double margin = 1e-6;  // cells: far more than rounding moves a vertex or a ray by, of the finest too
constexpr double steepest = 4;   // fall of a surface beside its outline: seen at 76 degrees
constexpr float lower = 1 - 1e-6F, higher = 1 + 1e-6F;

float to_float(double positive) { return static_cast<float>(std::min(positive, 1e38)); }

Index cell_of(double at, Index cells) { return std::min(static_cast<Index>(std::max(at, 0.0)), cells - 1); }

bool ahead_of_eye(double along_axis, double squared) {
  return along_axis > 0 && along_axis * along_axis >= least_cosine * least_cosine * squared && squared < 1e300;
}

}  // namespace

RayBundle::RayBundle(const Points& directions) : directions_(directions) {
  axis_.setZero();
  std::vector<Index> usable;
  for (Index i = 0; i < directions.rows(); ++i) {
    const Vec3 direction = directions.row(i);
    if (!direction.allFinite() || direction.isZero(0)) continue;
    usable.push_back(i);
    axis_ += direction.stableNormalized();
  }
  if (axis_.isZero(1e-6)) return;
  axis_.normalize();
  right_ = axis_.unitOrthogonal();
  down_ = axis_.cross(right_);
  constexpr double infinity = std::numeric_limits<double>::infinity(), no_less = 1e-100;
  double right = -infinity, bottom = -infinity;
  left_ = top_ = infinity;
  std::vector<double> u(usable.size()), v(usable.size());
  for (std::size_t k = 0; k < usable.size(); ++k) {
    const Vec3 direction = directions.row(usable[k]);
    const double ahead = direction.dot(axis_);
    if (!ahead_of_eye(ahead, direction.squaredNorm())) return;
    u[k] = direction.dot(right_) / ahead;
    v[k] = direction.dot(down_) / ahead;
    left_ = std::min(left_, u[k]), right = std::max(right, u[k]);
    top_ = std::min(top_, v[k]), bottom = std::max(bottom, v[k]);
  }
  const double width = std::max(right - left_, no_less), height = std::max(bottom - top_, no_less);
  const double cells = std::min(static_cast<double>(usable.size()) / rays_per_cell, most_cells);
  cells_per_slope_ = std::min({std::sqrt(cells / width / height), cells / width, cells / height, finest});
  columns_ = static_cast<Index>(width * cells_per_slope_) + 1;
  rows_ = static_cast<Index>(height * cells_per_slope_) + 1;
  in_view_ = true;

  std::vector<Index> cell(usable.size());
  first_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
  for (std::size_t k = 0; k < usable.size(); ++k) {
    u[k] = (u[k] - left_) * cells_per_slope_;
    v[k] = (v[k] - top_) * cells_per_slope_;
    cell[k] = cell_of(v[k], rows_) * columns_ + cell_of(u[k], columns_);
    ++first_[static_cast<std::size_t>(cell[k]) + 1];
  }
  for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
  std::vector<Index> next = first_;
  ray_.resize(usable.size()), u_.resize(usable.size()), v_.resize(usable.size()), ahead_.resize(usable.size());
  for (std::size_t k = 0; k < usable.size(); ++k) {
    const auto at = static_cast<std::size_t>(next[static_cast<std::size_t>(cell[k])]++);
    ray_[at] = usable[k];
    u_[at] = u[k];
    v_[at] = v[k];
    ahead_[at] = directions.row(usable[k]).dot(axis_);
  }
}

/// One surface before the rays.
struct RayBundle::Drawing {
  /// A vertex as the eye sees it: where in the plane (in cells) and how far along the axis.
  struct Corner {
    double u, v, depth;
  };

  const RayBundle& bundle;
  const Triangles& triangles;
  const Mat3& turn;
  Points from_eye_m;
  std::vector<Corner> corners;
  std::vector<RayHit> hits;
  std::vector<float> depth;  ///< of what a ray has met so far, in the rays' sorted order and rounded up; nothing is met before it

  Drawing(const RayBundle& rays, const Points& vertices_m, const Triangles& all, const Vec3& eye_m, const Mat3& turned)
      : bundle(rays), triangles(all), turn(turned), from_eye_m(vertices_m.rowwise() - eye_m.transpose()) {}

  /// False where the surface reaches around the eye.
  bool look() {
    const Vec3 axis = turn * bundle.axis_, right = turn * bundle.right_, down = turn * bundle.down_;
    const double per_slope = bundle.cells_per_slope_, left = bundle.left_ * per_slope, top = bundle.top_ * per_slope;
    corners.resize(static_cast<std::size_t>(from_eye_m.rows()));
    bool fine = true;
    for (Index i = 0; i < from_eye_m.rows(); ++i) {
      const Vec3 at = from_eye_m.row(i);
      const double along = at.dot(axis), cells = per_slope / along;
      corners[static_cast<std::size_t>(i)] = {at.dot(right) * cells - left, at.dot(down) * cells - top, along};
      fine = fine && ahead_of_eye(along, at.squaredNorm());
    }
    return fine;
  }

  void start(const std::vector<char>& skipped) {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    hits.resize(static_cast<std::size_t>(bundle.directions_.rows()));
    depth.assign(bundle.ray_.size(), infinity);
    for (std::size_t k = 0; !skipped.empty() && k < depth.size(); ++k)
      if (skipped[static_cast<std::size_t>(bundle.ray_[k])] != 0) depth[k] = -infinity;
  }

  bool faces_eye(Index triangle) const {
    const Corner &a = corner(triangle, 0), &b = corner(triangle, 1), &c = corner(triangle, 2);
    return (b.u - a.u) * (c.v - a.v) < (c.u - a.u) * (b.v - a.v);
  }

  void draw(Index triangle) {
    const Corner &a = corner(triangle, 0), &b = corner(triangle, 1), &c = corner(triangle, 2);
    const double left = std::min({a.u, b.u, c.u}) - margin, right = std::max({a.u, b.u, c.u}) + margin;
    const double top = std::min({a.v, b.v, c.v}) - margin, bottom = std::max({a.v, b.v, c.v}) + margin;
    const Index columns = bundle.columns_, rows = bundle.rows_;
    if (right < 0 || bottom < 0 || left > static_cast<double>(columns) || top > static_cast<double>(rows)) return;
    const Index from = cell_of(left, columns), to = cell_of(right, columns) + 1, last = cell_of(bottom, rows);
    const float nearest = to_float(std::min({a.depth, b.depth, c.depth})) * lower;
    // A point lies inside where it is to the same side of all edges; on a line that is as good as one, by its box.
    const double bu = b.u - a.u, bv = b.v - a.v, cu = c.u - a.u, cv = c.v - a.v, area = bu * cv - cu * bv;
    const double slack = margin * (right - left + bottom - top), side = area < 0 ? -1 : 1, size = side * area;
    const bool line = size <= 4 * slack;
    for (Index row = cell_of(top, rows); row <= last; ++row) {
      const auto end = static_cast<std::size_t>(bundle.first_[static_cast<std::size_t>(row * columns + to)]);
      for (auto k = static_cast<std::size_t>(bundle.first_[static_cast<std::size_t>(row * columns + from)]); k < end; ++k) {
        if (nearest > depth[k]) continue;
        const double u = bundle.u_[k] - a.u, v = bundle.v_[k] - a.v;
        const double of_c = side * (bu * v - bv * u), of_b = side * (u * cv - v * cu);
        if (line || std::min({of_b, of_c, size - of_b - of_c}) >= -slack) meet(triangle, k);
      }
    }
  }

  void meet(Index triangle, std::size_t k) {
    const Index ray = bundle.ray_[k];
    RayHit& best = hits[static_cast<std::size_t>(ray)];
    const double range = best.triangle < 0 ? std::numeric_limits<double>::infinity() : best.range_m;
    const Vec3 direction = turn * bundle.directions_.row(ray).transpose();
    const auto from_eye = [&](int i) { return from_eye_m.data() + 3 * triangles(triangle, i); };
    if (!WatertightRay(direction).hit(from_eye(0), from_eye(1), from_eye(2), range, best)) return;
    best.triangle = triangle;
    depth[k] = to_float(best.range_m * bundle.ahead_[k]) * higher;
  }

  /// Marks the rays that hit within some cells of the line between two vertices, where it is no further than what they hit.
  void mark_beside(const SurfaceEdge& edge, double cells, double margin, const std::vector<RayHit>& met, std::vector<char>& marked) const {
    const Corner &a = corners[static_cast<std::size_t>(edge.from)], &b = corners[static_cast<std::size_t>(edge.to)];
    const double top = std::min(a.v, b.v) - cells, bottom = std::max(a.v, b.v) + cells;
    const double left = std::min(a.u, b.u) - cells, right = std::max(a.u, b.u) + cells;
    const Index columns = bundle.columns_, rows = bundle.rows_;
    if (right < 0 || bottom < 0 || left > static_cast<double>(columns) || top > static_cast<double>(rows)) return;
    const double du = b.u - a.u, dv = b.v - a.v, squared = du * du + dv * dv;
    const Index from = cell_of(left, columns), to = cell_of(right, columns) + 1, last = cell_of(bottom, rows);
    for (Index row = cell_of(top, rows); row <= last; ++row) {
      const auto end = static_cast<std::size_t>(bundle.first_[static_cast<std::size_t>(row * columns + to)]);
      for (auto k = static_cast<std::size_t>(bundle.first_[static_cast<std::size_t>(row * columns + from)]); k < end; ++k) {
        const auto ray = static_cast<std::size_t>(bundle.ray_[k]);
        if (marked[ray] != 0 || met[ray].triangle < 0) continue;
        const double u = bundle.u_[k] - a.u, v = bundle.v_[k] - a.v;
        const double share = squared > 0 ? std::clamp((u * du + v * dv) / squared, 0.0, 1.0) : 0;
        const double beside = std::hypot(u - share * du, v - share * dv);
        if (beside > cells) continue;
        // The edge of the very surface that is hit lies further away by what that surface falls on the way to it.
        const double hit_m = met[ray].range_m * bundle.ahead_[k], edge_m = a.depth + share * (b.depth - a.depth);
        if (edge_m <= hit_m * (1 + steepest * margin)) marked[ray] = 1;
      }
    }
  }

  const Corner& corner(Index triangle, int k) const { return corners[static_cast<std::size_t>(triangles(triangle, k))]; }
};

std::optional<std::vector<RayHit>> RayBundle::meet(const Points& vertices_m, const Triangles& triangles, const Vec3& eye_m,
                                                   const Mat3& turn, const std::vector<char>& skipped) const {
  if (!in_view_ || !turn.allFinite()) return std::nullopt;
  Drawing drawing(*this, vertices_m, triangles, eye_m, turn);
  if (!drawing.look()) return std::nullopt;
  drawing.start(skipped);
  // What faces the eye is hit first as a rule, and spares the others.
  std::vector<Index> averted;
  for (Index t = 0; t < triangles.rows(); ++t) {
    if (drawing.faces_eye(t)) {
      drawing.draw(t);
    } else {
      averted.push_back(t);
    }
  }
  for (Index t : averted) drawing.draw(t);
  return std::move(drawing.hits);
}

std::optional<std::vector<char>> RayBundle::beside_outline(const Points& vertices_m, const Triangles& triangles,
                                                           const std::vector<SurfaceEdge>& edges, const Vec3& eye_m, const Mat3& turn,
                                                           const std::vector<RayHit>& hits, double margin_rad) const {
  if (!in_view_ || !turn.allFinite()) return std::nullopt;
  Drawing drawing(*this, vertices_m, triangles, eye_m, turn);
  if (!drawing.look()) return std::nullopt;
  std::vector<char> facing(static_cast<std::size_t>(triangles.rows())), marked(hits.size(), 0);
  for (Index t = 0; t < triangles.rows(); ++t) facing[static_cast<std::size_t>(t)] = drawing.faces_eye(t);
  const auto faces = [&](Index t) { return facing[static_cast<std::size_t>(t)]; };
  for (const SurfaceEdge& edge : edges) {
    const auto& [one, other] = edge.triangles;
    if (other < 0 || faces(one) != faces(other)) drawing.mark_beside(edge, margin_rad * cells_per_slope_, margin_rad, hits, marked);
  }
  return marked;
}

}  // namespace palpate::geometry
