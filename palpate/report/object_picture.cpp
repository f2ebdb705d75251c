// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/object_picture.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "palpate/core/mesh.hpp"
#include "palpate/report/depth_buffer.hpp"
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
