// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "palpate/core/math.hpp"

namespace palpate::geometry {

/// Squared distance of a point from a triangle, also one that is a line or a point. For many queries take TriangleTree.
inline double squared_distance_to_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 n = (b - a).cross(c - a);
  const double n2 = n.squaredNorm();
  if (n2 > 0 && n.cross(b - a).dot(p - a) >= 0 && n.cross(c - b).dot(p - b) >= 0 && n.cross(a - c).dot(p - c) >= 0) {
    const double h = n.dot(p - a);
    return h * h / n2;
  }
  const auto segment = [&p](const Vec3& u, const Vec3& v) {
    const Vec3 d = v - u;
    const double l2 = d.squaredNorm();
    return (p - u - (l2 > 0 ? std::clamp(d.dot(p - u) / l2, 0.0, 1.0) : 0.0) * d).squaredNorm();
  };
  return std::min({segment(a, b), segment(b, c), segment(c, a)});
}

}  // namespace palpate::geometry
