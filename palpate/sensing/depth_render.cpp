// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/depth_render.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::sensing {
namespace {

// A vertex on the image: pixel and inverse depth, which is what varies linearly over a triangle's image.
struct Corner {
  double u, v, inverse_depth;
};

/// First and last of the whole numbers 0 .. count - 1 within [from, to]. Without std::ceil and std::floor, which are calls
/// where the processor is not known to have instructions for them.
struct Whole {
  int first, last;
  Whole(double from, double to, int count) {
    const double low = std::clamp(from, 0.0, double(count)), high = std::clamp(to, -1.0, double(count - 1));
    first = int(low);
    first += first < low;
    last = int(high);
    last -= last > high;
  }
  bool none() const { return first > last; }
};

class Buffer {
 public:
  Buffer(int width, int height) : width_(width), height_(height), nearest_(DepthImage::Zero(height, width)) {}

  void draw(const Corner& a, const Corner& b, const Corner& c) {
    // Triangles that lie between the pixels' centres end here.
    const Whole rows(std::min({a.v, b.v, c.v}), std::max({a.v, b.v, c.v}), height_);
    if (rows.none() || Whole(std::min({a.u, b.u, c.u}), std::max({a.u, b.u, c.u}), width_).none()) return;
    const double area = (b.u - a.u) * (c.v - a.v) - (c.u - a.u) * (b.v - a.v);
    if (std::abs(area) < 1e-12) return;
    // Inverse depth as an affine function of the pixel.
    const double slope_u =
        ((b.inverse_depth - a.inverse_depth) * (c.v - a.v) - (c.inverse_depth - a.inverse_depth) * (b.v - a.v)) / area;
    const double slope_v =
        ((c.inverse_depth - a.inverse_depth) * (b.u - a.u) - (b.inverse_depth - a.inverse_depth) * (c.u - a.u)) / area;
    const std::array<const Corner*, 4> loop{&a, &b, &c, &a};
    for (int row = rows.first; row <= rows.last; ++row) {
      double left = 1e300, right = -1e300;
      for (int e = 0; e < 3; ++e) {  // where the row cuts the edges
        const Corner &p = *loop[e], &q = *loop[e + 1];
        if ((p.v < row && q.v < row) || (p.v > row && q.v > row)) continue;
        if (p.v == q.v) {
          left = std::min({left, p.u, q.u});
          right = std::max({right, p.u, q.u});
          continue;
        }
        const double u = p.u + (row - p.v) / (q.v - p.v) * (q.u - p.u);
        left = std::min(left, u);
        right = std::max(right, u);
      }
      if (!(left <= right)) continue;
      const auto [first, last] = Whole(left, right, width_);
      float* line = nearest_.data() + std::size_t(row) * width_;
      const auto start = float(a.inverse_depth + slope_u * (first - a.u) + slope_v * (row - a.v));
      for (int column = first; column <= last; ++column) {
        const float value = start + float(slope_u) * float(column - first);
        line[column] = std::max(line[column], value);
      }
    }
  }

  /// Ends the drawing.
  DepthImage depth() {
    float* const values = nearest_.data();
    for (Eigen::Index i = 0; i < nearest_.size(); ++i) values[i] = values[i] > 0 ? 1 / values[i] : 0;
    return std::move(nearest_);
  }

 private:
  int width_, height_;
  DepthImage nearest_;  // inverse depths
};

}  // namespace

DepthImage render_depth(const std::vector<PosedMesh>& bodies, const Camera& camera, const Pose& T_base_camera) {
  check(camera);
  Buffer buffer(camera.width_px, camera.height_px);
  const bool distorted = camera.distortion != DistortionModel::none;
  std::vector<Vec3> points;
  std::vector<Corner> corners;
  constexpr double unseen = -1;  // in place of the inverse depth: so far aside that the lens has no image of it
  const auto see = [&](const Vec3& p) {
    if (distorted) {
      const auto pixel = project(camera, p);
      return pixel ? Corner{pixel->x(), pixel->y(), 1 / p.z()} : Corner{0, 0, unseen};
    }
    const double inverse = 1 / p.z();
    return Corner{camera.fx_px * p.x() * inverse + camera.cx_px, camera.fy_px * p.y() * inverse + camera.cy_px, inverse};
  };
  const auto is_seen = [](const Corner& a, const Corner& b, const Corner& c) {
    return a.inverse_depth > 0 && b.inverse_depth > 0 && c.inverse_depth > 0;
  };
  // A triangle that reaches out of what the lens can see is halved, along its longest edge, until its pieces are in or out.
  const auto draw_pieces = [&](const Vec3& p, const Vec3& q, const Vec3& r, int halvings, const auto& again) -> void {
    const Corner a = see(p), b = see(q), c = see(r);
    if (is_seen(a, b, c)) return buffer.draw(a, b, c);
    const double pq = (q - p).norm(), qr = (r - q).norm(), rp = (p - r).norm(), longest = std::max({pq, qr, rp});
    const bool all_out = !(a.inverse_depth > 0 || b.inverse_depth > 0 || c.inverse_depth > 0);
    constexpr double fine_m = 0.005, coarse_m = 0.2;  // a piece that is out with all its corners and small is out
    if (halvings == 0 || longest < (all_out ? coarse_m : fine_m)) return;
    if (longest == pq) {
      const Vec3 m = 0.5 * (p + q);
      again(p, m, r, halvings - 1, again), again(m, q, r, halvings - 1, again);
    } else if (longest == qr) {
      const Vec3 m = 0.5 * (q + r);
      again(p, q, m, halvings - 1, again), again(p, m, r, halvings - 1, again);
    } else {
      const Vec3 m = 0.5 * (r + p);
      again(p, q, m, halvings - 1, again), again(m, q, r, halvings - 1, again);
    }
  };
  constexpr int most_halvings = 12;
  for (const PosedMesh& body : bodies) {
    const Pose T_camera_mesh = T_base_camera.inverse() * body.T_base_mesh;
    const double near_m = body.near_m;
    const Points& vertices = body.mesh->vertices_m;
    points.resize(std::size_t(vertices.rows()));
    corners.resize(points.size());
    for (Eigen::Index i = 0; i < vertices.rows(); ++i) {
      const Vec3 p = T_camera_mesh * Vec3(vertices.row(i));
      points[std::size_t(i)] = p;
      if (p.z() >= near_m) corners[std::size_t(i)] = see(p);
    }
    for (Eigen::Index t = 0; t < body.mesh->triangles.rows(); ++t) {
      const auto triangle = body.mesh->triangles.row(t);
      const std::array<std::size_t, 3> id{std::size_t(triangle(0)), std::size_t(triangle(1)), std::size_t(triangle(2))};
      const int behind = (points[id[0]].z() < near_m) + (points[id[1]].z() < near_m) + (points[id[2]].z() < near_m);
      if (behind == 0) {
        if (is_seen(corners[id[0]], corners[id[1]], corners[id[2]]))
          buffer.draw(corners[id[0]], corners[id[1]], corners[id[2]]);
        else
          draw_pieces(points[id[0]], points[id[1]], points[id[2]], most_halvings, draw_pieces);
      } else if (behind < 3) {
        std::vector<Vec3> polygon;  // the part in front of the near plane: 3 or 4 corners
        for (int k = 0; k < 3; ++k) {
          const Vec3 &p = points[id[k]], &q = points[id[(k + 1) % 3]];
          if (p.z() >= near_m) polygon.push_back(p);
          if ((p.z() >= near_m) != (q.z() >= near_m)) {
            Vec3 cut = p + (near_m - p.z()) / (q.z() - p.z()) * (q - p);
            cut.z() = near_m;
            polygon.push_back(cut);
          }
        }
        for (std::size_t k = 2; k < polygon.size(); ++k)
          draw_pieces(polygon[0], polygon[k - 1], polygon[k], most_halvings, draw_pieces);
      }
    }
  }
  return buffer.depth();
}

void check(const RenderMaskOptions& o) {
  const auto bad = [](const char* field) { throw Error("must not be negative", std::string("RenderMaskOptions.") + field); };
  if (!(o.depth_margin_m >= 0)) bad("depth_margin_m");
  if (!(o.depth_sigmas >= 0)) bad("depth_sigmas");
  if (!(o.lateral_margin_m >= 0)) bad("lateral_margin_m");
  if (!(o.lateral_margin_px >= 0)) bad("lateral_margin_px");
}

MaskImage mask_rendered(const DepthFrame& frame, DepthImage rendered_m, const RenderMaskOptions& options) {
  check(options);
  if (rendered_m.rows() != frame.depth_m.rows() || rendered_m.cols() != frame.depth_m.cols())
    throw Error("must have the size of the frame's image", "rendered_m");
  const int rows = int(rendered_m.rows()), columns = int(rendered_m.cols());
  const double focal = std::min(frame.camera.fx_px, frame.camera.fy_px);

  // Widen the outline: every pixel at the body's border (also against a part of it that lies farther back) stamps a disc.
  struct Stamp {
    int row, column;
    float z;
  };
  std::vector<Stamp> border;
  const auto step = float(options.depth_margin_m + 0.01);
  for (int row = 0; row < rows; ++row) {
    const float* const here = rendered_m.data() + std::ptrdiff_t(row) * columns;
    for (int column = 0; column < columns; ++column) {
      const float z = here[column];
      if (z == 0) continue;
      const auto farther = [z, step](float other) { return other == 0 || other > z + step; };
      if ((column > 0 && farther(here[column - 1])) || (column + 1 < columns && farther(here[column + 1])) ||
          (row > 0 && farther(here[column - columns])) || (row + 1 < rows && farther(here[column + columns])))
        border.push_back({row, column, z});
    }
  }
  for (const auto& [row, column, z] : border) {
    const double reach = options.lateral_margin_px + options.lateral_margin_m * focal / z;
    const int whole = int(reach);
    for (int r = std::max(0, row - whole); r <= std::min(rows - 1, row + whole); ++r)
      for (int c = std::max(0, column - whole); c <= std::min(columns - 1, column + whole); ++c)
        if ((r - row) * (r - row) + (c - column) * (c - column) <= reach * reach)
          if (float& wide = rendered_m(r, c); wide == 0 || wide > z) wide = z;
  }

  // The model is looked up once, not by name for every pixel.
  axial_sigma_m(frame.noise, {1.0, 0.0, frame.camera.fx_px});  // throws when it cannot be told
  const auto model = frame.noise.model == "constant" ? nullptr : depth_noise_model(frame.noise.model).axial_sigma_m;
  MaskImage mask = MaskImage::Zero(rows, columns);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const double body = rendered_m(row, column);
      if (body == 0) continue;
      const double seen = frame.depth_m(row, column);
      if (!(seen > 0)) continue;
      const double sigma = model ? model({body, 0.0, frame.camera.fx_px}) : frame.noise.sigma_m;
      mask(row, column) = seen > body - options.depth_margin_m - options.depth_sigmas * sigma;
    }
  return mask;
}

}  // namespace palpate::sensing
