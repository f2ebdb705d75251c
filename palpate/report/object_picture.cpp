// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/object_picture.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "palpate/core/mesh.hpp"
#include "palpate/report/thinning.hpp"

namespace palpate::report {
namespace {

using nlohmann::json;

Points decoded_points(const std::string& text, const json& box) {
  const std::vector<std::uint8_t> bytes = from_base64(text);
  Points points(static_cast<Eigen::Index>(bytes.size() / 6), 3);
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto k = static_cast<std::size_t>(6 * i + 2 * axis);
      const double q = bytes[k] + 256.0 * bytes[k + 1];
      points(i, axis) =
          box["origin_m"][static_cast<std::size_t>(axis)].get<double>() + box["size_m"].get<double>() * q / 65535;
    }
  }
  return points;
}

Triangles decoded_triangles(const std::string& text, std::size_t vertices) {
  const std::vector<std::uint8_t> bytes = from_base64(text);
  const std::size_t width = vertices <= 65536 ? 2 : 4;
  Triangles triangles(static_cast<Eigen::Index>(bytes.size() / (3 * width)), 3);
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) {
      std::uint32_t index = 0;
      for (std::size_t b = 0; b < width; ++b)
        index |= std::uint32_t{bytes[static_cast<std::size_t>(3 * t + k) * width + b]} << (8 * b);
      triangles(t, k) = static_cast<Index>(std::min<std::size_t>(index, vertices - 1));
    }
  }
  return triangles;
}

Vec3 vector_of(const json& numbers) {
  Vec3 v = Vec3::Zero();
  for (std::size_t k = 0; k < 3 && k < numbers.size(); ++k) {
    if (numbers[k].is_number()) v(static_cast<Eigen::Index>(k)) = numbers[k].get<double>();
  }
  return v;
}

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
    const double area = (p[1] - p[0]).head<2>().x() * (p[2] - p[0]).y() - (p[1] - p[0]).y() * (p[2] - p[0]).x();
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
        if (w0 < 0 || w1 < 0 || w2 < 0) continue;
        put(x, y, w0 * p[0].z() + w1 * p[1].z() + w2 * p[2].z(), w0 * colour[0] + w1 * colour[1] + w2 * colour[2]);
      }
    }
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
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }
  void put(int x, int y, double depth, const Vec3& colour) {
    const std::size_t i = at(x, y);
    if (depth >= depth_[i]) return;
    depth_[i] = static_cast<float>(depth);
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

void draw_arrow(DepthBuffer& buffer, const Vec3& tip, const Vec3& force, double length) {
  const Vec3 towards = force.normalized();
  const Vec3 colour(184, 5, 77);
  const double radius = 0.028 * length;
  for (double s = 0; s < length; s += 0.35 * radius) {
    const bool head = s < 0.26 * length;
    const double r = head ? 2.6 * radius * s / (0.26 * length) : radius;
    buffer.spot(buffer.project(tip - s * towards), std::max(0.6, r * buffer.scale()), colour);
  }
}

}  // namespace

Colour size_colour(double share) {
  static constexpr std::array<std::array<double, 3>, 8> map = {{{238, 241, 242},
                                                                {196, 226, 216},
                                                                {142, 205, 196},
                                                                {84, 176, 188},
                                                                {45, 139, 176},
                                                                {30, 98, 154},
                                                                {29, 58, 120},
                                                                {27, 27, 78}}};
  const double at = std::clamp(std::isfinite(share) ? share : 0.0, 0.0, 1.0) * (map.size() - 1);
  const auto i = std::min(static_cast<std::size_t>(at), map.size() - 2);
  const double t = at - static_cast<double>(i);
  const auto mix = [&](std::size_t k) {
    return static_cast<std::uint8_t>(std::lround(map[i][k] * (1 - t) + map[i + 1][k] * t));
  };
  return {mix(0), mix(1), mix(2)};
}

ObjectPicture draw_object(const json& page, int width, int height) {
  ObjectPicture result;
  const json& box = page["box"];
  const Points rest = decoded_points(page["mesh"]["rest"].get<std::string>(), box);
  const Triangles triangles =
      decoded_triangles(page["mesh"]["triangles"].get<std::string>(), static_cast<std::size_t>(rest.rows()));
  if (rest.rows() == 0) return result;
  Points shape = rest;
  for (std::size_t s = 0; s < page["steps"].size(); ++s) {
    const json& step = page["steps"][s];
    if (!step.contains("surface")) continue;
    const Points moved = decoded_points(step["surface"].get<std::string>(), box);
    if (moved.rows() != rest.rows()) continue;
    const double largest = (moved - rest).rowwise().norm().maxCoeff();
    if (largest <= result.largest_displacement_m) continue;
    result.largest_displacement_m = largest;
    result.step = s;
    shape = moved;
  }
  const bool has_step = result.step < page["steps"].size();
  const json step = has_step ? page["steps"][result.step] : json::object();
  const Vec3 force = has_step ? vector_of(step["force_n"]) : Vec3::Zero();
  const Vec3 gravity = page["scene"].is_object() ? vector_of(page["scene"]["gravity_m_s2"]) : Vec3::Zero();
  const Vec3 up = gravity.norm() > 1e-6 ? Vec3(-gravity.normalized()) : Vec3(Vec3::UnitZ());
  Vec3 level = -force + force.dot(up) * up;  // look from the side that is pushed
  if (level.norm() < 0.2 * force.norm() || level.norm() < 1e-12) {
    // Pushed from above: look from where the sensors looked.
    Vec3 seen = Vec3::Zero();
    if (step.contains("points")) {
      const Points points = decoded_points(step["points"].get<std::string>(), box);
      if (points.rows() > 0) seen = (points.colwise().mean() - rest.colwise().mean()).transpose();
    }
    level = seen - seen.dot(up) * up;
    if (level.norm() < 0.02 * (rest.colwise().maxCoeff() - rest.colwise().minCoeff()).norm()) {
      level = Vec3(1, -1.6, 0) - Vec3(1, -1.6, 0).dot(up) * up;
    }
    if (level.norm() < 1e-6) level = Vec3::UnitZ();
  }
  level = Eigen::AngleAxisd(0.6, up) * level.normalized();

  const double size = (rest.colwise().maxCoeff() - rest.colwise().minCoeff()).norm() / 1.6;
  const Vec3 contact = has_step ? vector_of(step["contact_m"]) : Vec3::Zero();
  Eigen::Index nearest = 0;
  (rest.rowwise() - contact.transpose()).rowwise().squaredNorm().minCoeff(&nearest);
  const Vec3 tip = contact + (shape.row(nearest) - rest.row(nearest)).transpose();
  const double arrow = force.norm() > 0 ? 0.42 * size : 0;

  Points around(shape.rows() + rest.rows() + 1, 3);
  around << shape, rest, (tip - arrow * (force.norm() > 0 ? Vec3(force.normalized()) : Vec3(Vec3::Zero()))).transpose();
  DepthBuffer buffer(2 * width, 2 * height);
  buffer.look(-(level * 2.3 + up * 1.0), up, around);

  Points normals = Points::Zero(shape.rows(), 3);
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Vec3 a = shape.row(triangles(t, 0)), b = shape.row(triangles(t, 1)), c = shape.row(triangles(t, 2));
    const Eigen::RowVector3d normal = (b - a).cross(c - a).transpose();
    for (int k = 0; k < 3; ++k) normals.row(triangles(t, k)) += normal;
  }
  const Vec3 light = buffer.light();
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    std::array<Vec3, 3> corners, colours;
    for (std::size_t k = 0; k < 3; ++k) {
      const Index v = triangles(t, static_cast<Eigen::Index>(k));
      corners[k] = buffer.project(shape.row(v));
      const double moved = (shape.row(v) - rest.row(v)).norm();
      const Colour colour = size_colour(result.largest_displacement_m > 0 ? moved / result.largest_displacement_m : 0);
      const double shade = 0.55 + 0.45 * std::abs(normals.row(v).transpose().normalized().dot(light));
      colours[k] = shade * Vec3(colour.r, colour.g, colour.b);
    }
    buffer.triangle(corners, colours);
  }
  if (step.contains("points")) {
    const Points points = decoded_points(step["points"].get<std::string>(), box);
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      Vec3 p = buffer.project(points.row(i));
      p.z() -= 0.004 * size;  // points lie on the surface: half of them would be hidden by it
      buffer.spot(p, points.rows() < 3000 ? 3.2 : 2.0, Vec3(217, 84, 0));
    }
  }
  if (arrow > 0) draw_arrow(buffer, tip, force, arrow);
  result.picture = buffer.halved();
  return result;
}

}  // namespace palpate::report
