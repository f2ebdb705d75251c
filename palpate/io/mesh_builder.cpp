// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/mesh_builder.hpp"

#include <Eigen/Geometry>
#include <algorithm>

#include "palpate/core/error.hpp"

namespace palpate::io {

namespace {

/// Twice the area of a triangle in the plane, positive counter-clockwise.
double doubled_area(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

}  // namespace

/// Convex polygons become a fan; of others ears are clipped (Meisters 1975), in the plane of their mean normal (Newell).
void MeshBuilder::polygon(const std::vector<Index>& corners) {
  const auto fan = [&](const std::vector<Index>& left) {
    for (std::size_t i = 2; i < left.size(); ++i) triangle(left[0], left[i - 1], left[i]);
  };
  const auto known = static_cast<Index>(coordinates_.size() / 3);
  if (corners.size() < 4 || std::any_of(corners.begin(), corners.end(), [&](Index i) { return i < 0 || i >= known; })) return fan(corners);
  const auto place = [&](Index i) { return Vec3(Eigen::Map<const Vec3>(coordinates_.data() + 3 * std::size_t(i))); };
  Vec3 normal = Vec3::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i)
    normal += (place(corners[i]) - place(corners[0])).cross(place(corners[(i + 1) % corners.size()]) - place(corners[0]));
  if (!(normal.norm() > 0)) return fan(corners);
  const Vec3 x = normal.unitOrthogonal(), y = normal.normalized().cross(x);
  const auto flat = [&](Index i) { return Eigen::Vector2d(x.dot(place(i)), y.dot(place(i))); };
  std::vector<Index> left = corners;
  const auto turn = [&](std::size_t i) {
    const std::size_t n = left.size();
    return doubled_area(flat(left[(i + n - 1) % n]), flat(left[i]), flat(left[(i + 1) % n]));
  };
  const double straight = -1e-9 * normal.norm();
  const auto is_convex = [&] {
    for (std::size_t i = 0; i < left.size(); ++i)
      if (turn(i) < straight) return false;
    return true;
  };
  while (left.size() > 3 && !is_convex()) {
    const std::size_t n = left.size();
    std::size_t ear = n;
    for (std::size_t i = 0; i < n && ear == n; ++i) {
      if (!(turn(i) > -straight)) continue;
      const Index before = left[(i + n - 1) % n], after = left[(i + 1) % n];
      const Eigen::Vector2d a = flat(before), b = flat(left[i]), c = flat(after);
      const bool is_empty = std::none_of(left.begin(), left.end(), [&](Index other) {
        if (other == before || other == left[i] || other == after) return false;
        const Eigen::Vector2d p = flat(other);
        return doubled_area(a, b, p) >= 0 && doubled_area(b, c, p) >= 0 && doubled_area(c, a, p) >= 0;
      });
      if (is_empty) ear = i;
    }
    if (ear == n) break;  // it crosses itself: no way to cut it is right
    triangle(left[(ear + n - 1) % n], left[ear], left[(ear + 1) % n]);
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  fan(left);
}

void MeshBuilder::tetrahedron(const Index* nodes, int count) {
  std::vector<Index>& list = count == 10 ? tets10_ : tets4_;
  list.insert(list.end(), nodes, nodes + count);
}

MeshData MeshBuilder::build(const std::string& name) {
  if (!tets4_.empty() && !tets10_.empty()) {
    throw Error("mixes linear and quadratic tetrahedra; write one kind only", name);
  }
  MeshData mesh;
  mesh.points_m = Eigen::Map<const Points>(coordinates_.data(), static_cast<Eigen::Index>(coordinates_.size() / 3), 3);
  mesh.triangles = Eigen::Map<const Triangles>(triangles_.data(), static_cast<Eigen::Index>(triangles_.size() / 3), 3);
  const std::vector<Index>& tets = tets10_.empty() ? tets4_ : tets10_;
  const Eigen::Index columns = tets10_.empty() ? 4 : 10;
  mesh.tetrahedra = Eigen::Map<const Tetrahedra>(tets.data(), static_cast<Eigen::Index>(tets.size()) / columns, columns);
  return mesh;
}

}  // namespace palpate::io
