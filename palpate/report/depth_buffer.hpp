// SPDX-License-Identifier: Apache-2.0
// Inside of the report's pictures: triangles become pixels without a display.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/report/canvas.hpp"

namespace palpate::report {

/// A depth buffer seen along `forward`, without perspective, so that lengths can be compared in the picture.
class DepthBuffer {
 public:
  DepthBuffer(int width, int height) : width_(width), height_(height) {
    const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    depth_.assign(pixels, std::numeric_limits<float>::infinity());
    rgba_.assign(pixels * 4, 0);
  }

  void look(const Vec3& towards, const Vec3& up, const Points& around) {
    forward_ = towards.normalized();
    right_ = forward_.cross(up).normalized();
    up_ = right_.cross(forward_);
    double x0 = 1e300, x1 = -1e300, y0 = 1e300, y1 = -1e300;
    for (Eigen::Index i = 0; i < around.rows(); ++i) {
      const Vec3 p = around.row(i);
      x0 = std::min(x0, p.dot(right_)), x1 = std::max(x1, p.dot(right_));
      y0 = std::min(y0, p.dot(up_)), y1 = std::max(y1, p.dot(up_));
    }
    scale_ = 0.94 * std::min(width_ / std::max(x1 - x0, 1e-12), height_ / std::max(y1 - y0, 1e-12));
    offset_x_ = width_ / 2.0 - scale_ * (x0 + x1) / 2;
    offset_y_ = height_ / 2.0 + scale_ * (y0 + y1) / 2;
  }

  Vec3 project(const Vec3& p) const {
    return {offset_x_ + scale_ * p.dot(right_), offset_y_ - scale_ * p.dot(up_), p.dot(forward_)};
  }
  double scale() const { return scale_; }
  Vec3 light() const { return (0.35 * right_ + 0.75 * up_ - 1.0 * forward_).normalized(); }

  /// Colours at the corners are blended over the triangle.
  void triangle(const std::array<Vec3, 3>& p, const std::array<Vec3, 3>& colour) {
    shares(p, [&](int x, int y, const Vec3& w) {
      put(x, y, w.x() * p[0].z() + w.y() * p[1].z() + w.z() * p[2].z(),
          w.x() * colour[0] + w.y() * colour[1] + w.z() * colour[2]);
    });
  }

  /// One colour with darker sides of `edge_px` pixels, so that elements can be told apart.
  void facet(const std::array<Vec3, 3>& p, const Vec3& colour, double edge_px) {
    const auto across = [&](int i) { return (p[(i + 2) % 3] - p[(i + 1) % 3]).head<2>().norm(); };
    const double area = std::abs((p[1] - p[0]).x() * (p[2] - p[0]).y() - (p[1] - p[0]).y() * (p[2] - p[0]).x());
    // pixels from a side: the corner's share times its height above that side
    Vec3 height;
    for (int i = 0; i < 3; ++i) height[i] = area / std::max(across(i), 1e-9);
    shares(p, [&](int x, int y, const Vec3& w) {
      const bool side = w.cwiseProduct(height).minCoeff() < edge_px;
      put(x, y, w.x() * p[0].z() + w.y() * p[1].z() + w.z() * p[2].z(), side ? Vec3(0.45 * colour) : colour);
    });
  }

  void spot(const Vec3& p, double radius, const Vec3& colour) {
    for (int y = static_cast<int>(p.y() - radius); y <= static_cast<int>(p.y() + radius); ++y) {
      for (int x = static_cast<int>(p.x() - radius); x <= static_cast<int>(p.x() + radius); ++x) {
        if (x < 0 || y < 0 || x >= width_ || y >= height_) continue;
        if (std::hypot(x + 0.5 - p.x(), y + 0.5 - p.y()) <= radius) put(x, y, p.z(), colour);
      }
    }
  }

  Picture halved() const {
    Picture picture{width_ / 2, height_ / 2, {}};
    picture.rgba.resize(static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height) * 4);
    for (int y = 0; y < picture.height; ++y) {
      for (int x = 0; x < picture.width; ++x) {
        std::array<int, 4> sum{};
        for (int k = 0; k < 4; ++k) {
          const std::uint8_t* from = &rgba_[at(2 * x + k % 2, 2 * y + k / 2) * 4];
          for (std::size_t c = 0; c < 3; ++c) sum[c] += from[c] * from[3] / 255;
          sum[3] += from[3];
        }
        std::uint8_t* to = &picture.rgba[(static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
                                          static_cast<std::size_t>(x)) *
                                         4];
        for (std::size_t c = 0; c < 3; ++c)
          to[c] = static_cast<std::uint8_t>(sum[3] > 0 ? std::min(255, sum[c] * 255 / sum[3]) : 255);
        to[3] = static_cast<std::uint8_t>(sum[3] / 4);
      }
    }
    return picture;
  }

 private:
  /// Visits the pixels of a triangle with their shares of its corners.
  template <class Visit>
  void shares(const std::array<Vec3, 3>& p, Visit visit) const {
    const double area = (p[1] - p[0]).x() * (p[2] - p[0]).y() - (p[1] - p[0]).y() * (p[2] - p[0]).x();
    if (std::abs(area) < 1e-12) return;
    const auto low = [&](int axis) { return std::min({p[0](axis), p[1](axis), p[2](axis)}); };
    const auto high = [&](int axis) { return std::max({p[0](axis), p[1](axis), p[2](axis)}); };
    for (int y = std::max(0, static_cast<int>(low(1))); y <= std::min(height_ - 1, static_cast<int>(high(1)) + 1); ++y) {
      for (int x = std::max(0, static_cast<int>(low(0))); x <= std::min(width_ - 1, static_cast<int>(high(0)) + 1); ++x) {
        const double px = x + 0.5, py = y + 0.5;
        const auto side = [&](const Vec3& a, const Vec3& b) {
          return (b.x() - a.x()) * (py - a.y()) - (b.y() - a.y()) * (px - a.x());
        };
        const double w0 = side(p[1], p[2]) / area, w1 = side(p[2], p[0]) / area, w2 = 1 - w0 - w1;
        if (w0 >= 0 && w1 >= 0 && w2 >= 0) visit(x, y, Vec3(w0, w1, w2));
      }
    }
  }
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }
  void put(int x, int y, double depth, const Vec3& colour) {
    const std::size_t i = at(x, y);
    const auto kept = static_cast<float>(depth);
    if (kept >= depth_[i]) return;
    depth_[i] = kept;
    for (int k = 0; k < 3; ++k)
      rgba_[i * 4 + static_cast<std::size_t>(k)] = static_cast<std::uint8_t>(std::clamp(colour(k), 0.0, 255.0));
    rgba_[i * 4 + 3] = 255;
  }

  int width_, height_;
  Vec3 forward_, right_, up_;
  double scale_ = 1, offset_x_ = 0, offset_y_ = 0;
  std::vector<float> depth_;
  std::vector<std::uint8_t> rgba_;
};

}  // namespace palpate::report
