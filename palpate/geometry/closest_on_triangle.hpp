// SPDX-License-Identifier: Apache-2.0
// Inside of TriangleTree: the point of one triangle that is closest to a given one, in double.
#pragma once

#include <algorithm>
#include <array>
#include <limits>

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

struct Corner {
  Vec3 a = Vec3::Zero(), ab = Vec3::Zero(), ac = Vec3::Zero();
  bool thin = false;  ///< height below 1e-6 of the longest edge: barycentrics from products of dot products cancel
};

inline Corner make_corner(const Points& v, const Triangles& t, Index i) {
  Corner c;
  c.a = v.row(t(i, 0)).transpose();
  c.ab = v.row(t(i, 1)).transpose() - c.a;
  c.ac = v.row(t(i, 2)).transpose() - c.a;
  const double longest = std::max({c.ab.squaredNorm(), c.ac.squaredNorm(), (c.ac - c.ab).squaredNorm()});
  c.thin = !(c.ab.cross(c.ac).squaredNorm() > 1e-12 * longest * longest);
  return c;
}

struct Candidate {
  double squared = 0, v = 0, w = 0;  ///< point = a + v ab + w ac
};

namespace detail {

inline double squared_at(const Corner& t, const Vec3& ap, double v, double w) {
  return (ap - v * t.ab - w * t.ac).squaredNorm();
}

inline double along(const Vec3& edge, const Vec3& from_start) {
  const double length2 = edge.squaredNorm();
  return length2 > 0 ? std::clamp(edge.dot(from_start) / length2, 0.0, 1.0) : 0.0;
}

/// Needles, points and lines: the best of three edges, and of the inside where a normal exists.
inline Candidate closest_thin(const Corner& t, const Vec3& ap) {
  const double s = along(t.ab, ap), u = along(t.ac, ap), r = along(t.ac - t.ab, ap - t.ab);
  std::array<Candidate, 3> edges{Candidate{0, s, 0}, Candidate{0, 0, u}, Candidate{0, 1 - r, r}};
  Candidate best{std::numeric_limits<double>::infinity(), 0, 0};
  for (Candidate& c : edges) {
    c.squared = squared_at(t, ap, c.v, c.w);
    if (c.squared < best.squared) best = c;
  }
  const Vec3 n = t.ab.cross(t.ac);
  const double n2 = n.squaredNorm();
  if (n2 > 0) {
    const double v = ap.cross(t.ac).dot(n) / n2, w = t.ab.cross(ap).dot(n) / n2;
    if (v >= 0 && w >= 0 && v + w <= 1) {
      const Candidate inside{squared_at(t, ap, v, w), v, w};
      if (inside.squared < best.squared) best = inside;
    }
  }
  return best;
}

}  // namespace detail

/// Ericson, Real-Time Collision Detection (2005), section 5.1.5: the Voronoi regions of corners, edges and face in turn.
inline Candidate closest_on(const Corner& t, const Vec3& p) {
  const Vec3 ap = p - t.a;
  if (t.thin) return detail::closest_thin(t, ap);
  const double d1 = t.ab.dot(ap), d2 = t.ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return {ap.squaredNorm(), 0, 0};
  const Vec3 bp = ap - t.ab;
  const double d3 = t.ab.dot(bp), d4 = t.ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return {bp.squaredNorm(), 1, 0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double v = d1 / (d1 - d3);
    return {(ap - v * t.ab).squaredNorm(), v, 0};
  }
  const Vec3 cp = ap - t.ac;
  const double d5 = t.ab.dot(cp), d6 = t.ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return {cp.squaredNorm(), 0, 1};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double w = d2 / (d2 - d6);
    return {(ap - w * t.ac).squaredNorm(), 0, w};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {detail::squared_at(t, ap, 1 - w, w), 1 - w, w};
  }
  const double scale = 1 / (va + vb + vc);
  const double v = vb * scale, w = vc * scale;
  return {detail::squared_at(t, ap, v, w), v, w};
}

}  // namespace palpate::geometry
