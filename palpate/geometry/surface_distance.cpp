// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/surface_distance.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "palpate/geometry/solid.hpp"

namespace palpate::geometry {

CountedPoints not_buried(const TriMesh& surface, const Solid& solid) {
  const double step = 1e-4 * solid.diagonal_m();
  return {[&surface, &solid, step](const Vec3& p, Index triangle) {
            const auto corner = [&](int k) -> Vec3 {
              return surface.vertices_m.row(surface.triangles(triangle, k)).transpose();
            };
            const Vec3 n = step * (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
            return !(solid.inside(p + n) && solid.inside(p - n));
          },
          20 * step};
}

SurfaceDistance one_sided_distance(const TriMesh& from, const TriMesh& to, int samples, const CountedPoints& counted) {
  const TriangleTree tree(to);
  const auto corner = [&](Index t, int k) { return Vec3(from.vertices_m.row(from.triangles(t, k)).transpose()); };
  std::vector<double> cumulative(from.triangles.rows());
  double area = 0;
  for (Index t = 0; t < from.triangles.rows(); ++t) {
    area += 0.5 * (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm();
    cumulative[t] = area;
  }
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> u;
  double sum = 0, largest = 0;
  int count = 0;
  const double ask2 = counted.counts ? counted.from_m * counted.from_m : std::numeric_limits<double>::infinity();
  const auto counts = [&](const ClosestPoint& c, const Vec3& p, Index triangle) {
    return c.squared_distance_m2 <= ask2 || counted.counts(p, triangle);
  };
  std::size_t t = 0;
  Index hint = -1;
  for (int i = 0; i < samples; ++i) {
    const double at = (i + u(rng)) * area / samples;
    while (t + 1 < cumulative.size() && cumulative[t] < at) ++t;
    double v = u(rng), w = u(rng);
    if (v + w > 1) v = 1 - v, w = 1 - w;
    const auto id = static_cast<Index>(t);
    const Vec3 p = (1 - v - w) * corner(id, 0) + v * corner(id, 1) + w * corner(id, 2);
    const ClosestPoint c = tree.closest(p, hint);
    hint = c.triangle;
    if (!counts(c, p, id)) continue;
    ++count;
    sum += c.squared_distance_m2;
    largest = std::max(largest, c.squared_distance_m2);
  }
  std::vector<char> done(from.vertices_m.rows(), 0);
  for (Index i = 0; i < from.triangles.rows(); ++i)
    for (int k = 0; k < 3; ++k)
      if (!done[from.triangles(i, k)]) {
        done[from.triangles(i, k)] = 1;
        const ClosestPoint c = tree.closest(corner(i, k), hint);
        hint = c.triangle;
        if (c.squared_distance_m2 > largest && counts(c, corner(i, k), i)) largest = c.squared_distance_m2;
      }
  return {std::sqrt(sum / std::max(1, count)), std::sqrt(largest)};
}

SurfaceDistance surface_distance(const TriMesh& a, const TriMesh& b, int samples, const CountedPoints& counted) {
  const SurfaceDistance ab = one_sided_distance(a, b, samples, counted), ba = one_sided_distance(b, a, samples);
  return {std::sqrt(0.5 * (ab.rms_m * ab.rms_m + ba.rms_m * ba.rms_m)), std::max(ab.hausdorff_m, ba.hausdorff_m)};
}

}  // namespace palpate::geometry
