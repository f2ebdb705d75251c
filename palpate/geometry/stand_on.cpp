// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/stand_on.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "palpate/geometry/make_room.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/tet_quality.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/geometry/union_find.hpp"

namespace palpate::geometry {
namespace {

constexpr double plane_reach = 0.15;         // of the longest edge: faces that near the plane are laid on it
constexpr double least_volume = 0.2;   // of an element, that it keeps
constexpr double lowest_quality = 0.15;  // tet_quality: 9 degrees
constexpr double outline_reach = 0.7;  // of the mean edge around a node: further it does not go out
constexpr double beside = 0.5;         // of the longest edge: faces with a corner further beside the foot are not of it
constexpr double sharp = 0.9;          // cosine between two pieces of the outline that meet at a corner

double signed_volume(const TetMesh& mesh, Index t) {
  const auto node = [&](int k) { return Vec3(mesh.nodes_m.row(mesh.tetrahedra(t, k))); };
  return (node(1) - node(0)).cross(node(2) - node(0)).dot(node(3) - node(0)) / 6;
}

double height_m(const Plane& plane, const Vec3& p) { return plane.normal.dot(p - plane.point_m); }

Vec3 on(const Plane& plane, const Vec3& p) { return p - height_m(plane, p) * plane.normal; }

/// Elements that a move left too little of their volume, or made worse than `least_quality` and than they were.
std::vector<Index> worse_than(double least_quality, const TetMesh& old, const TetMesh& volume) {
  std::vector<Index> worse;
  for (Index t = 0; t < volume.tetrahedra.rows(); ++t) {
    const double now = tet_quality(volume, t);
    const bool good = now >= least_quality || now >= tet_quality(old, t);
    if (!good || signed_volume(volume, t) < least_volume * signed_volume(old, t)) worse.push_back(t);
  }
  return worse;
}

/// Takes back half of a move, and half again, where it leaves an element too little of its volume, or makes one worse than
/// `least_quality`.
void keep_elements(const Points& before, TetMesh& volume, double least_quality) {
  constexpr int halvings = 6;  // then the rest
  const TetMesh old{before, volume.tetrahedra};
  for (int round = 0;; ++round) {
    std::set<Index> back;
    for (const Index t : worse_than(least_quality, old, volume)) {
      for (int k = 0; k < 4; ++k) {
        const Index i = volume.tetrahedra(t, k);
        if (volume.nodes_m.row(i) != before.row(i)) back.insert(i);
      }
    }
    if (back.empty()) return;
    for (Index i : back) {
      if (round < halvings) volume.nodes_m.row(i) = 0.5 * (volume.nodes_m.row(i) + before.row(i)).eval();
      else volume.nodes_m.row(i) = before.row(i);
    }
  }
}

/// After a move of boundary nodes. Without a wish for good elements only what would turn over is taken back.
void settle(const Triangles& faces, const Points& before, TetMesh& volume, double least_quality) {
  if (least_quality > 0) make_room(faces, before, least_quality, volume);
  keep_elements(before, volume, least_quality);
}

/// Boundary triangles in the volume's numbering.
Triangles boundary_of(const TetMesh& volume) {
  const TriMesh boundary = boundary_surface(volume).surface;  // in a numbering of its own: matched by place
  std::map<std::array<double, 3>, Index> node_at;
  for (Index i = 0; i < volume.nodes_m.rows(); ++i)
    node_at[{volume.nodes_m(i, 0), volume.nodes_m(i, 1), volume.nodes_m(i, 2)}] = i;
  Triangles faces(boundary.triangles.rows(), 3);
  for (Index t = 0; t < faces.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const auto v = boundary.vertices_m.row(boundary.triangles(t, k));
      faces(t, k) = node_at.at({v.x(), v.y(), v.z()});
    }
  return faces;
}

/// Nodes that held each other back, and each other's elements good: one after the other, nearest first, at the cost of worse
/// elements where it must be. A foot that lost a corner is worse.
void lay_one_by_one(const Plane& plane, const Triangles& faces, const std::set<Index>& laid, double least_quality, TetMesh& volume) {
  std::vector<std::pair<double, Index>> off;
  for (Index i : laid) {
    const double off_m = std::abs(height_m(plane, volume.nodes_m.row(i)));
    if (off_m > 1e-12) off.emplace_back(off_m, i);
  }
  std::sort(off.begin(), off.end());
  for (double floor = least_quality; floor >= lowest_quality; floor *= 0.5) {
    for (auto& [off_m, i] : off) {
      if (off_m == 0) continue;
      const TetMesh old = volume;
      volume.nodes_m.row(i) = on(plane, old.nodes_m.row(i)).transpose();
      make_room(faces, old.nodes_m, floor, volume);
      if (worse_than(floor, old, volume).empty()) off_m = 0;
      else volume.nodes_m = old.nodes_m;
    }
  }
}

/// @param least_quality  of elements, for which faces are rather left where they are
/// @param may_lie  whether a node, at its place in the plane, may be laid on it, given the face's longest edge
std::set<Index> lay_faces(const Plane& plane, const Triangles& faces, TetMesh& volume, double least_quality,
                          const std::function<bool(const Vec3&, double)>& may_lie) {
  std::set<Index> laid;
  for (Index t = 0; t < faces.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(volume.nodes_m.row(faces(t, k))); };
    const double edge =
        std::max({(corner(1) - corner(0)).norm(), (corner(2) - corner(1)).norm(), (corner(0) - corner(2)).norm()});
    bool along = std::abs((corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized().dot(plane.normal)) > 0.7;
    for (int k = 0; along && k < 3; ++k) {
      const double off_m = plane.normal.dot(corner(k) - plane.point_m);
      along = std::abs(off_m) < plane_reach * edge && may_lie(corner(k) - off_m * plane.normal, edge);
    }
    for (int k = 0; along && k < 3; ++k) laid.insert(faces(t, k));
  }
  const Points before = volume.nodes_m;
  for (Index i : laid) volume.nodes_m.row(i) = on(plane, before.row(i)).transpose();
  settle(faces, before, volume, least_quality);
  if (least_quality > 0) lay_one_by_one(plane, faces, laid, least_quality, volume);
  return laid;
}

/// The surface's own triangles in the plane.
std::vector<Index> foot_triangles(const Plane& plane, const TriMesh& surface) {
  const Vec3 extent = surface.vertices_m.colwise().maxCoeff() - surface.vertices_m.colwise().minCoeff();
  const double flat = 1e-4 * extent.norm();
  std::vector<Index> in_plane;
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    bool all = true;
    for (int k = 0; k < 3; ++k)
      all = all && std::abs(plane.normal.dot(Vec3(surface.vertices_m.row(surface.triangles(t, k))) - plane.point_m)) < flat;
    if (all) in_plane.push_back(t);
  }
  return in_plane;
}

TriMesh foot_of(const Plane& plane, const TriMesh& surface) {
  TriMesh foot{surface.vertices_m, {}};
  const std::vector<Index> triangles = foot_triangles(plane, surface);
  foot.triangles = surface.triangles(triangles, Eigen::all);
  return foot;
}

struct Outline {
  std::vector<std::pair<Vec3, Vec3>> pieces;
  std::vector<Vec3> corners;
};

Outline outline_of(const Plane& plane, const TriMesh& surface) {
  std::map<std::pair<Index, Index>, int> uses;
  for (const Index t : foot_triangles(plane, surface))
    for (int k = 0; k < 3; ++k)
      ++uses[std::minmax<Index>(surface.triangles(t, k), surface.triangles(t, (k + 1) % 3))];
  Outline outline;
  std::map<Index, std::vector<Vec3>> directions;
  for (const auto& [edge, count] : uses) {
    if (count != 1) continue;
    const Vec3 a = surface.vertices_m.row(edge.first), b = surface.vertices_m.row(edge.second);
    outline.pieces.emplace_back(a, b);
    directions[edge.first].push_back((b - a).normalized());
    directions[edge.second].push_back((a - b).normalized());
  }
  for (const auto& [vertex, out] : directions)
    if (out.size() == 2 && -out[0].dot(out[1]) < sharp) outline.corners.emplace_back(surface.vertices_m.row(vertex));
  return outline;
}

Vec3 nearest_on(const Outline& outline, const Vec3& p) {
  Vec3 best = outline.pieces.front().first;
  for (const auto& [a, b] : outline.pieces) {
    const double length2 = (b - a).squaredNorm();
    const Vec3 at = length2 > 0 ? Vec3(a + std::clamp((p - a).dot(b - a) / length2, 0.0, 1.0) * (b - a)) : a;
    if ((at - p).squaredNorm() < (best - p).squaredNorm()) best = at;
  }
  return best;
}

}  // namespace

std::vector<FinerNear> finer_at_feet(const Plane& plane, const TriMesh& surface) {
  // Triangles that share a vertex are of one foot.
  const std::vector<Index> triangles = foot_triangles(plane, surface);
  UnionFind together(surface.vertices_m.rows());
  for (const Index t : triangles)
    for (int k = 1; k < 3; ++k) together.join(surface.triangles(t, 0), surface.triangles(t, k));
  std::map<Index, std::vector<Index>> feet;
  for (const Index t : triangles) feet[together.root(surface.triangles(t, 0))].push_back(t);
  std::vector<FinerNear> finer;
  for (const auto& [foot, members] : feet) {
    double area = 0;
    for (const Index t : members) {
      const Vec3 a = surface.vertices_m.row(surface.triangles(t, 0)), b = surface.vertices_m.row(surface.triangles(t, 1)),
                 c = surface.vertices_m.row(surface.triangles(t, 2));
      area += 0.5 * (b - a).cross(c - a).norm();
    }
    const double edge_m = 0.12 * std::sqrt(area);
    const std::size_t first = finer.size();
    for (const Index t : members)
      for (int k = 0; k < 3; ++k) {
        const Vec3 at = surface.vertices_m.row(surface.triangles(t, k));
        const bool known = std::any_of(finer.begin() + static_cast<std::ptrdiff_t>(first), finer.end(),
                                       [&](const auto& one) { return (one.point_m - at).norm() < 0.7 * edge_m; });
        if (!known) finer.push_back({at, 0.7 * edge_m, edge_m});
      }
  }
  return finer;
}

void lay_on(const Plane& plane, TetMesh& volume, double least_quality) {
  lay_faces(plane, boundary_of(volume), volume, least_quality, [](const Vec3&, double) { return true; });
}

void stand_on(const Plane& plane, const TriMesh& surface, TetMesh& volume, double least_quality) {
  const Outline outline = outline_of(plane, surface);
  if (outline.pieces.empty()) return lay_on(plane, volume, least_quality);
  // A round object leaves the plane so slowly that faces beside its foot lie as near to the plane as those of the foot. One held
  // node too many on one side, and the object tilts under its load: only what can reach the outline is laid.
  const TriangleTree foot(foot_of(plane, surface));
  const auto distance_m = [&](const Vec3& p) { return std::sqrt(foot.closest(p).squared_distance_m2); };
  const Triangles faces = boundary_of(volume);
  const std::set<Index> laid = lay_faces(plane, faces, volume, least_quality, [&](const Vec3& p, double edge_m) {
    return distance_m(p) < beside * edge_m;
  });

  // Nodes on the plane from which the boundary leaves it, with the mean length of its edges there.
  const auto on_plane = [&](Index i) {
    return laid.count(i) > 0 && std::abs(plane.normal.dot(Vec3(volume.nodes_m.row(i)) - plane.point_m)) < 1e-12;
  };
  std::map<Index, std::pair<double, int>> edges;
  std::set<Index> rim;
  for (Index t = 0; t < faces.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const Index i = faces(t, k), j = faces(t, (k + 1) % 3);
      for (const auto& [a, b] : {std::pair{i, j}, std::pair{j, i}}) {
        if (!on_plane(a)) continue;
        edges[a].first += (volume.nodes_m.row(a) - volume.nodes_m.row(b)).norm();
        ++edges[a].second;
        if (!on_plane(b)) rim.insert(a);
      }
    }
  const Points before = volume.nodes_m;
  const auto may_go = [&](Index i, const Vec3& to) {
    return (to - Vec3(before.row(i))).norm() < outline_reach * edges[i].first / edges[i].second;
  };
  std::set<Index> moved;
  for (const Vec3& corner : outline.corners) {
    Index nearest = -1;
    for (Index i : rim)
      if (moved.count(i) == 0 &&
          (nearest < 0 || (Vec3(before.row(i)) - corner).norm() < (Vec3(before.row(nearest)) - corner).norm()))
        nearest = i;
    if (nearest < 0 || !may_go(nearest, corner)) continue;
    volume.nodes_m.row(nearest) = corner.transpose();
    moved.insert(nearest);
  }
  for (Index i : rim) {
    if (moved.count(i) > 0) continue;
    const Vec3 to = nearest_on(outline, before.row(i));
    if (may_go(i, to)) volume.nodes_m.row(i) = to.transpose();
  }
  // The surface's own faces may lie off the plane by rounding of the file: the support asks for the plane.
  for (Index i : rim) {
    const Vec3 node = volume.nodes_m.row(i);
    volume.nodes_m.row(i) -= plane.normal.dot(node - plane.point_m) * plane.normal.transpose();
  }
  settle(faces, before, volume, least_quality);
}

}  // namespace palpate::geometry
