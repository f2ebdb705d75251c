// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/mesh_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "palpate/core/error.hpp"
#include "palpate/geometry/union_find.hpp"

namespace palpate::geometry {
namespace {

/// An edge as one triangle sees it.
struct HalfEdge {
  Index low, high;
  Index corner;  ///< 3 * triangle + k: runs from corner k to k + 1
  bool ascending;
};

std::vector<HalfEdge> sorted_half_edges(const Triangles& t, const std::vector<bool>& skip) {
  std::vector<HalfEdge> edges;
  edges.reserve(3 * t.rows());
  for (Index i = 0; i < t.rows(); ++i) {
    if (!skip.empty() && skip[i]) continue;
    for (int k = 0; k < 3; ++k) {
      const Index a = t(i, k), b = t(i, (k + 1) % 3);
      edges.push_back({std::min(a, b), std::max(a, b), 3 * i + k, a < b});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.low, a.high, a.corner) < std::tie(b.low, b.high, b.corner);
  });
  return edges;
}

struct SortedTriangle {
  std::array<Index, 3> key;
  Index triangle;
  bool ascending;  ///< goes round its corners in the order of `key`, or of a turn of it
};

/// Copies stand beside each other.
std::vector<SortedTriangle> sorted_triangles(const Triangles& t) {
  std::vector<SortedTriangle> list(t.rows());
  for (Index i = 0; i < t.rows(); ++i) {
    std::array<Index, 3> key{t(i, 0), t(i, 1), t(i, 2)};
    std::sort(key.begin(), key.end());
    const int first = key[0] == t(i, 0) ? 0 : key[0] == t(i, 1) ? 1 : 2;
    list[i] = {key, i, t(i, (first + 1) % 3) == key[1]};
  }
  std::sort(list.begin(), list.end(), [](const SortedTriangle& a, const SortedTriangle& b) {
    return std::tie(a.key, a.triangle) < std::tie(b.key, b.triangle);
  });
  return list;
}

struct SurfaceTopology {
  Index boundary = 0, non_manifold = 0, inconsistent = 0, pinched = 0, components = 0;
};

SurfaceTopology topology_of(const Triangles& t, Index vertices, const std::vector<bool>& skip) {
  SurfaceTopology out;
  const auto edges = sorted_half_edges(t, skip);
  UnionFind fans(3 * t.rows()), pieces(vertices);
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t j = i;
    int up = 0;
    for (; j < edges.size() && edges[j].low == edges[i].low && edges[j].high == edges[i].high; ++j) {
      up += edges[j].ascending;
      // corners at the two ends of the edge, of this triangle and of the first one
      const auto end = [&](const HalfEdge& e, bool low) {
        const Index tri = e.corner / 3, k = e.corner % 3;
        return low == e.ascending ? 3 * tri + k : 3 * tri + (k + 1) % 3;
      };
      fans.join(end(edges[i], true), end(edges[j], true));
      fans.join(end(edges[i], false), end(edges[j], false));
    }
    const auto n = static_cast<int>(j - i);
    out.boundary += n == 1;
    out.non_manifold += n > 2;
    out.inconsistent += n == 2 && up != 1;
    pieces.join(edges[i].low, edges[i].high);
    i = j;
  }
  std::vector<Index> fan(vertices, -1);
  std::vector<bool> pinched(vertices, false), used(vertices, false);
  for (Index i = 0; i < t.rows(); ++i) {
    if (!skip.empty() && skip[i]) continue;
    for (int k = 0; k < 3; ++k) {
      const Index v = t(i, k), f = fans.root(3 * i + k);
      used[v] = true;
      if (fan[v] >= 0 && fan[v] != f) pinched[v] = true;
      fan[v] = f;
    }
  }
  for (Index v = 0; v < vertices; ++v) {
    out.pinched += pinched[v];
    out.components += used[v] && pieces.root(v) == v;
  }
  return out;
}

void check_indices(Index lowest, Index highest, Eigen::Index vertices, const char* where) {
  if (lowest < 0 || highest >= vertices)
    throw Error(
        fmt::format("a vertex index is outside 0..{}; the file is damaged or belongs to other vertices", vertices - 1),
        where);
}

std::string plural(Index n, const char* one, const char* many) { return fmt::format("{} {}", n, n == 1 ? one : many); }

void add(std::vector<Finding>& list, const char* code, std::string message, bool fatal = false) {
  list.push_back({code, std::move(message), fatal});
}

void add_size_finding(std::vector<Finding>& list, const Vec3& extent) {
  if (std::string guess = unit_guess(extent.maxCoeff()); !guess.empty()) add(list, "units", std::move(guess));
}

/// Faces opposite to corner k, outward for a positive determinant.
constexpr std::array<std::array<int, 3>, 4> tet_faces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

struct Face {
  std::array<Index, 3> key;
  Index tet;
  int opposite;
};

std::vector<Face> sorted_faces(const Tetrahedra& t) {
  std::vector<Face> out;
  out.reserve(4 * t.rows());
  for (Index i = 0; i < t.rows(); ++i)
    for (int k = 0; k < 4; ++k) {
      std::array<Index, 3> key{t(i, tet_faces[k][0]), t(i, tet_faces[k][1]), t(i, tet_faces[k][2])};
      std::sort(key.begin(), key.end());
      out.push_back({key, i, k});
    }
  std::sort(out.begin(), out.end(),
            [](const Face& a, const Face& b) { return a.key != b.key ? a.key < b.key : a.tet < b.tet; });
  return out;
}

}  // namespace

SurfaceCheck check_surface(const TriMesh& mesh) {
  SurfaceCheck out;
  out.vertices = static_cast<Index>(mesh.vertices_m.rows());
  out.triangles = static_cast<Index>(mesh.triangles.rows());
  if (out.triangles == 0) {
    add(out.findings, "empty", "the surface has no triangle", true);
    return out;
  }
  check_indices(mesh.triangles.minCoeff(), mesh.triangles.maxCoeff(), out.vertices, "surface: triangles");
  if (!mesh.vertices_m.allFinite()) {
    add(out.findings, "not_finite", "a vertex is not a finite number", true);
    return out;
  }
  std::vector<Index> vertex_of;
  const TriMesh welded = weld(mesh, &vertex_of);
  out.coincident_vertices = out.vertices - static_cast<Index>(welded.vertices_m.rows());
  std::vector<bool> used(out.vertices, false);
  for (Index i = 0; i < out.triangles; ++i)
    for (int k = 0; k < 3; ++k) used[mesh.triangles(i, k)] = true;
  out.unused_vertices = static_cast<Index>(std::count(used.begin(), used.end(), false));

  // bounds, area and volume of what the triangles use; volume about the middle, where cancellation is least
  out.min_m.setConstant(std::numeric_limits<double>::infinity());
  out.max_m = -out.min_m;
  for (Index v = 0; v < out.vertices; ++v)
    if (used[v]) {
      out.min_m = out.min_m.cwiseMin(mesh.vertices_m.row(v).transpose());
      out.max_m = out.max_m.cwiseMax(mesh.vertices_m.row(v).transpose());
    }
  const Vec3 middle = 0.5 * (out.min_m + out.max_m);
  double volume = 0;
  std::vector<bool> skip(out.triangles, false);
  const std::vector<char> again = copies(welded.triangles), shared = shared_faces(welded.triangles);
  for (Index i = 0; i < out.triangles; ++i) {
    const Eigen::Matrix<Index, 1, 3> t = welded.triangles.row(i);
    const Vec3 a = welded.vertices_m.row(t[0]).transpose() - middle, b = welded.vertices_m.row(t[1]).transpose() - middle,
               c = welded.vertices_m.row(t[2]).transpose() - middle;
    const double area = 0.5 * (b - a).cross(c - a).norm();
    const double longest2 = std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
    if (shared[i]) {
      ++out.shared_faces;
      skip[i] = true;
      continue;
    }
    out.area_m2 += area;
    volume += a.dot(b.cross(c)) / 6;
    if (!(area > 1e-12 * longest2)) ++out.degenerate_triangles;
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) {
      skip[i] = true;  // collapsed: its edges would look non-manifold
    } else if (again[i]) {
      ++out.duplicate_triangles;
      skip[i] = true;
    }
  }
  out.shared_faces /= 2;
  const SurfaceTopology topology = topology_of(welded.triangles, static_cast<Index>(welded.vertices_m.rows()), skip);
  out.boundary_edges = topology.boundary;
  out.non_manifold_edges = topology.non_manifold;
  out.inconsistent_edges = topology.inconsistent;
  out.pinched_vertices = topology.pinched;
  out.components = topology.components;
  if (out.watertight()) out.volume_m3 = volume;

  auto& f = out.findings;
  if (out.degenerate_triangles > 0)
    add(f, "degenerate_triangles", plural(out.degenerate_triangles, "triangle has", "triangles have") + " no area");
  if (out.shared_faces > 0)
    add(f, "shared_faces", "parts of the surface have " + plural(out.shared_faces, "triangle", "triangles") + " in common: they are taken as one body there");
  if (out.duplicate_triangles > 0)
    add(f, "duplicate_triangles", plural(out.duplicate_triangles, "triangle is", "triangles are") + " there twice");
  if (out.boundary_edges > 0)
    add(f, "open_surface",
        "the surface has holes: " + plural(out.boundary_edges, "edge belongs", "edges belong") + " to one triangle only");
  if (out.non_manifold_edges > 0)
    add(f, "non_manifold_edges",
        plural(out.non_manifold_edges, "edge belongs", "edges belong") + " to three or more triangles");
  if (out.inconsistent_edges > 0)
    add(f, "inconsistent_orientation",
        "some triangles are flipped: across " + plural(out.inconsistent_edges, "edge", "edges") +
            " inside and outside change");
  if (out.pinched_vertices > 0)
    add(f, "pinched_vertices",
        "the surface touches itself in " + plural(out.pinched_vertices, "single point", "single points"));
  if (out.volume_m3 && *out.volume_m3 < 0) add(f, "inside_out", "the surface is inside out: all its triangles face inwards");
  if (out.components > 1)
    add(f, "several_components", fmt::format("the surface falls into {} separate pieces", out.components));
  add_size_finding(f, out.max_m - out.min_m);
  return out;
}

VolumeCheck check_volume(const TetMesh& mesh) {
  VolumeCheck out;
  const Tetrahedra& t = mesh.tetrahedra;
  out.nodes = static_cast<Index>(mesh.nodes_m.rows());
  out.tetrahedra = static_cast<Index>(t.rows());
  if (out.tetrahedra == 0) {
    add(out.findings, "empty", "the volume mesh has no tetrahedron", true);
    return out;
  }
  if (t.cols() != 4 && t.cols() != 10)
    throw Error(fmt::format("{} columns, but a tetrahedron has 4 or 10 nodes", t.cols()), "volume mesh: tetrahedra");
  check_indices(t.minCoeff(), t.maxCoeff(), out.nodes, "volume mesh: tetrahedra");
  if (!mesh.nodes_m.allFinite()) {
    add(out.findings, "not_finite", "a node is not a finite number", true);
    return out;
  }
  std::vector<bool> used(out.nodes, false);
  out.min_m.setConstant(std::numeric_limits<double>::infinity());
  out.max_m = -out.min_m;
  out.min_dihedral_deg = 180;
  out.worst_quality = 1;
  for (Index i = 0; i < out.tetrahedra; ++i) {
    for (Index k = 0; k < t.cols(); ++k) used[t(i, k)] = true;
    std::array<Vec3, 4> x;
    double longest2 = 0;
    for (int k = 0; k < 4; ++k) {
      x[k] = mesh.nodes_m.row(t(i, k)).transpose();
      out.min_m = out.min_m.cwiseMin(x[k]);
      out.max_m = out.max_m.cwiseMax(x[k]);
      for (int l = 0; l < k; ++l) longest2 = std::max(longest2, (x[k] - x[l]).squaredNorm());
    }
    const Vec3 a = x[1] - x[0], b = x[2] - x[0], c = x[3] - x[0];
    const double det = a.dot(b.cross(c));
    out.volume_m3 += det / 6;
    if (std::abs(det) <= 1e-12 * longest2 * std::sqrt(longest2))
      ++out.degenerate;
    else if (det < 0)
      ++out.inverted;
    const auto [low, high] = dihedral_range_deg(x[0], x[1], x[2], x[3]);
    out.min_dihedral_deg = std::min(out.min_dihedral_deg, low);
    out.max_dihedral_deg = std::max(out.max_dihedral_deg, high);
    const double areas = 0.5 * (a.cross(b).norm() + b.cross(c).norm() + c.cross(a).norm() + (b - a).cross(c - a).norm());
    const double across =
        (a.squaredNorm() * b.cross(c) + b.squaredNorm() * c.cross(a) + c.squaredNorm() * a.cross(b)).norm();
    // inradius = det / (2 areas), circumradius = across / (2 det)
    out.worst_quality =
        std::min(out.worst_quality, across > 0 && areas > 0 ? 3 * det * std::abs(det) / (areas * across) : 0.0);
  }
  out.unused_nodes = static_cast<Index>(std::count(used.begin(), used.end(), false));

  UnionFind pieces(out.tetrahedra);
  const auto all = sorted_faces(t);
  for (std::size_t i = 0; i < all.size();) {
    std::size_t j = i;
    for (; j < all.size() && all[j].key == all[i].key; ++j) pieces.join(all[i].tet, all[j].tet);
    out.overfull_faces += j - i > 2;
    i = j;
  }
  for (Index i = 0; i < out.tetrahedra; ++i) out.components += pieces.root(i) == i;
  const BoundarySurface boundary = boundary_surface(mesh);
  const auto topology =
      topology_of(boundary.surface.triangles, static_cast<Index>(boundary.surface.vertices_m.rows()), std::vector<bool>());
  out.non_manifold_boundary_edges = topology.non_manifold;
  out.pinched_boundary_vertices = topology.pinched;

  auto& f = out.findings;
  if (out.inverted > 0)
    add(f, "inverted_elements", plural(out.inverted, "tetrahedron is", "tetrahedra are") + " inside out", true);
  if (out.degenerate > 0)
    add(f, "degenerate_elements", plural(out.degenerate, "tetrahedron has", "tetrahedra have") + " no volume", true);
  if (out.overfull_faces > 0)
    add(f, "overlapping_elements",
        plural(out.overfull_faces, "face is", "faces are") + " shared by three or more tetrahedra", true);
  if (out.unused_nodes > 0)
    add(f, "unused_nodes", plural(out.unused_nodes, "node belongs", "nodes belong") + " to no tetrahedron");
  if (out.components > 1)
    add(f, "several_components",
        fmt::format("the volume falls into {} pieces that share no face; each needs a support of its own", out.components));
  if (out.non_manifold_boundary_edges > 0)
    add(f, "non_manifold_edges",
        "the boundary touches itself along " + plural(out.non_manifold_boundary_edges, "edge", "edges"));
  if (out.pinched_boundary_vertices > 0)
    add(f, "pinched_vertices",
        "the boundary touches itself in " + plural(out.pinched_boundary_vertices, "single point", "single points"));
  if (out.inverted + out.degenerate == 0 && (out.min_dihedral_deg < 5 || out.max_dihedral_deg > 170))
    add(f, "poor_elements",
        fmt::format("the flattest tetrahedra have dihedral angles of {:.1f} and {:.1f} degrees: the solution is inaccurate "
                    "there and slow to find; remesh the object",
                    out.min_dihedral_deg, out.max_dihedral_deg));
  add_size_finding(f, out.max_m - out.min_m);
  return out;
}

BoundarySurface boundary_surface(const TetMesh& mesh) {
  const auto all = sorted_faces(mesh.tetrahedra);
  std::vector<Face> outer;
  for (std::size_t i = 0; i < all.size();) {
    std::size_t j = i;
    while (j < all.size() && all[j].key == all[i].key) ++j;
    if (j - i == 1) outer.push_back(all[i]);
    i = j;
  }
  // in the order of the elements, so that the surface is as local in memory as the volume
  std::sort(outer.begin(), outer.end(),
            [](const Face& a, const Face& b) { return std::tie(a.tet, a.opposite) < std::tie(b.tet, b.opposite); });
  std::vector<Index> vertex(mesh.nodes_m.rows(), -1);
  BoundarySurface out;
  for (const Face& f : outer)
    for (const Index n : f.key) vertex[n] = 0;
  for (Index n = 0; n < static_cast<Index>(vertex.size()); ++n)
    if (vertex[n] == 0) {
      vertex[n] = static_cast<Index>(out.node.size());
      out.node.push_back(n);
    }
  out.surface.vertices_m.resize(static_cast<Eigen::Index>(out.node.size()), 3);
  for (std::size_t i = 0; i < out.node.size(); ++i) out.surface.vertices_m.row(i) = mesh.nodes_m.row(out.node[i]);
  out.surface.triangles.resize(static_cast<Eigen::Index>(outer.size()), 3);
  for (std::size_t i = 0; i < outer.size(); ++i) {
    out.tetrahedron.push_back(outer[i].tet);
    for (int k = 0; k < 3; ++k)
      out.surface.triangles(i, k) = vertex[mesh.tetrahedra(outer[i].tet, tet_faces[outer[i].opposite][k])];
  }
  return out;
}

TriMesh weld(const TriMesh& mesh, std::vector<Index>* vertex_of) {
  const auto n = static_cast<Index>(mesh.vertices_m.rows());
  const auto& x = mesh.vertices_m;
  std::vector<Index> order(n), to(n);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](Index a, Index b) {
    for (int k = 0; k < 3; ++k)
      if (x(a, k) != x(b, k)) return x(a, k) < x(b, k);
    return a < b;
  });
  for (Index i = 0; i < n; ++i) to[order[i]] = i > 0 && x.row(order[i]) == x.row(order[i - 1]) ? to[order[i - 1]] : order[i];
  TriMesh out;
  out.vertices_m.resize(n, 3);
  Index kept = 0;
  for (Index v = 0; v < n; ++v) {  // the first copy has the lowest index, so it is already numbered
    if (to[v] == v) {
      out.vertices_m.row(kept) = x.row(v);
      to[v] = kept++;
    } else {
      to[v] = to[to[v]];
    }
  }
  out.vertices_m.conservativeResize(kept, 3);
  out.triangles = mesh.triangles.unaryExpr([&](Index v) { return to[v]; });
  if (vertex_of != nullptr) *vertex_of = std::move(to);
  return out;
}

std::vector<char> copies(const Triangles& triangles) {
  const std::vector<SortedTriangle> list = sorted_triangles(triangles);
  std::vector<char> out(triangles.rows(), 0);
  for (std::size_t i = 1; i < list.size(); ++i) out[list[i].triangle] = list[i].key == list[i - 1].key;
  return out;
}

std::vector<char> shared_faces(const Triangles& triangles) {
  const std::vector<SortedTriangle> list = sorted_triangles(triangles);
  std::vector<char> shared(triangles.rows(), 0);
  std::vector<bool> left_out(triangles.rows(), false);
  bool any = false;
  for (std::size_t i = 0, j = 0; i < list.size(); i = j) {
    for (j = i; j < list.size() && list[j].key == list[i].key; ++j) {}
    if (j - i != 2 || list[i].ascending == list[i + 1].ascending) continue;
    any = true;
    for (const std::size_t k : {i, i + 1}) shared[list[k].triangle] = 1, left_out[list[k].triangle] = true;
  }
  if (!any) return shared;
  const std::vector<HalfEdge> edges = sorted_half_edges(triangles, left_out);
  bool closed = !edges.empty();
  for (std::size_t i = 0, j = 0; i < edges.size() && closed; i = j) {
    int balance = 0;
    for (j = i; j < edges.size() && edges[j].low == edges[i].low && edges[j].high == edges[i].high; ++j) balance += edges[j].ascending ? 1 : -1;
    closed = balance == 0;
  }
  if (!closed) std::fill(shared.begin(), shared.end(), 0);
  return shared;
}

TriMesh without_shared_faces(const TriMesh& mesh) {
  TriMesh welded = weld(mesh);
  const std::vector<char> shared = shared_faces(welded.triangles);
  std::vector<Index> kept, vertex_of(static_cast<std::size_t>(welded.vertices_m.rows()), -1), used;
  for (Index i = 0; i < welded.triangles.rows(); ++i)
    if (shared[i] == 0) kept.push_back(i);
  if (kept.size() == shared.size()) return mesh;
  TriMesh out;
  out.triangles.resize(static_cast<Eigen::Index>(kept.size()), 3);
  for (std::size_t i = 0; i < kept.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      const Index v = welded.triangles(kept[i], k);
      if (vertex_of[v] < 0) vertex_of[v] = static_cast<Index>(used.size()), used.push_back(v);
      out.triangles(static_cast<Eigen::Index>(i), k) = vertex_of[v];
    }
  }
  out.vertices_m = welded.vertices_m(used, Eigen::all);
  return out;
}

std::string unit_guess(double longest_edge_m) {
  const double l = longest_edge_m;
  if (!(l > 0) || (l >= 2e-3 && l <= 5)) return {};
  const auto size = fmt::format("this object is {:.3g} m long", l);
  if (l > 5 && l <= 20) return size + ": inches or decimetres?";
  if (l > 20 && l <= 5000) return size + ": millimetres?";
  if (l > 5000) return size + ": micrometres?";
  return size + ": is it scaled twice, or in kilometres?";
}

std::pair<double, double> dihedral_range_deg(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const std::array<Vec3, 4> x{a, b, c, d};
  std::array<Vec3, 4> n;
  for (int k = 0; k < 4; ++k) n[k] = (x[tet_faces[k][1]] - x[tet_faces[k][0]]).cross(x[tet_faces[k][2]] - x[tet_faces[k][0]]);
  double low = M_PI, high = 0;
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j) {
      const double angle = std::atan2(n[i].cross(n[j]).norm(), -n[i].dot(n[j]));
      low = std::min(low, angle);
      high = std::max(high, angle);
    }
  return {low * 180 / M_PI, high * 180 / M_PI};
}

}  // namespace palpate::geometry
