// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/sharp_edges.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "palpate/geometry/union_find.hpp"

namespace palpate::geometry {
namespace {

constexpr double smooth = 0.766;  // cosine of 40 degrees between neighbouring triangles
constexpr double edge_reach = 0.7;     // of the wished edge: further a vertex does not go

/// The triangles at every edge of a surface, edges in the order of their vertices.
class EdgeUses {
 public:
  struct Use {
    Index to, triangle;
    bool operator<(const Use& other) const { return std::tie(to, triangle) < std::tie(other.to, other.triangle); }
  };
  explicit EdgeUses(const TriMesh& surface) : first_(surface.vertices_m.rows() + 1, 0), uses_(3 * surface.triangles.rows()) {
    const auto each = [&](const auto& use) {
      for (Index t = 0; t < surface.triangles.rows(); ++t)
        for (int k = 0; k < 3; ++k) {
          const Index a = surface.triangles(t, k), b = surface.triangles(t, (k + 1) % 3);
          use(std::min(a, b), Use{std::max(a, b), t});
        }
    };
    each([&](Index from, const Use&) { ++first_[from + 1]; });
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    std::vector<Index> next(first_.begin(), first_.end() - 1);
    each([&](Index from, const Use& use) { uses_[next[from]++] = use; });
    for (std::size_t v = 0; v + 1 < first_.size(); ++v) std::sort(uses_.begin() + first_[v], uses_.begin() + first_[v + 1]);
  }
  void for_each(const auto& visit) const {
    for (std::size_t v = 0; v + 1 < first_.size(); ++v)
      for (Index begin = first_[v], end = begin; begin < first_[v + 1]; begin = end) {
        while (end < first_[v + 1] && uses_[end].to == uses_[begin].to) ++end;
        visit(static_cast<Index>(v), uses_[begin].to, std::span(uses_.begin() + begin, uses_.begin() + end));
      }
  }

 private:
  std::vector<Index> first_;  // use of a vertex that is the lower one of its edges
  std::vector<Use> uses_;
};

}  // namespace

/// Smooth parts of a surface, and the edges between them.
struct SharpEdges::Parts {
  std::vector<Index> of;                                                        // a triangle
  std::vector<double> area_m2;                                                  // a part
  std::map<std::pair<Index, Index>, std::vector<std::pair<Vec3, Vec3>>> edges;  // of two parts, the lower first
  std::vector<std::pair<Vec3, std::set<Index>>> corners;                        // where three or more meet
};

namespace {

using Parts = SharpEdges::Parts;

Parts parts_of(const Solid& solid) {
  const TriMesh& surface = solid.surface();
  const auto triangles = static_cast<Index>(surface.triangles.rows());
  const EdgeUses at_edge(surface);

  UnionFind smooth_parts(triangles);
  at_edge.for_each([&](Index, Index, std::span<const EdgeUses::Use> both) {
    if (both.size() == 2 && solid.normal(both[0].triangle).dot(solid.normal(both[1].triangle)) > smooth)
      smooth_parts.join(both[0].triangle, both[1].triangle);
  });

  Parts parts;
  std::map<Index, Index> number;
  for (Index t = 0; t < triangles; ++t) {
    const auto [own, fresh] = number.emplace(smooth_parts.root(t), static_cast<Index>(number.size()));
    if (fresh) parts.area_m2.push_back(0);
    parts.of.push_back(own->second);
    const auto corner = [&](int k) -> Vec3 { return surface.vertices_m.row(surface.triangles(t, k)).transpose(); };
    parts.area_m2[own->second] += 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
  }
  std::map<Index, std::set<Index>> at_vertex;
  at_edge.for_each([&](Index from, Index to, std::span<const EdgeUses::Use> both) {
    if (both.size() != 2 || parts.of[both[0].triangle] == parts.of[both[1].triangle]) return;
    const auto pair = std::minmax(parts.of[both[0].triangle], parts.of[both[1].triangle]);
    parts.edges[pair].emplace_back(surface.vertices_m.row(from).transpose(), surface.vertices_m.row(to).transpose());
    for (const Index v : {from, to}) at_vertex[v].insert({pair.first, pair.second});
  });
  for (const auto& [v, meeting] : at_vertex)
    if (meeting.size() > 2) parts.corners.emplace_back(surface.vertices_m.row(v).transpose(), meeting);
  return parts;
}

struct Place {
  Vec3 at, along;  ///< and the direction of the edge there; zero in corners
};

/// Where a vertex between these parts belongs.
std::optional<Place> place_of(const Vec3& at, const std::set<Index>& between, const Parts& parts, double within) {
  std::optional<Place> best;
  const auto offer = [&](const Vec3& p, const Vec3& along) {
    const double limit = best ? (best->at - at).norm() : within;
    if ((p - at).norm() < limit) best = Place{p, along};
  };
  if (between.size() > 2) {
    for (const auto& [corner, meeting] : parts.corners)
      if (std::includes(meeting.begin(), meeting.end(), between.begin(), between.end())) offer(corner, Vec3::Zero());
    return best;
  }
  const auto shared = parts.edges.find({*between.begin(), *between.rbegin()});
  if (shared == parts.edges.end()) return best;
  for (const auto& [a, b] : shared->second) {
    const double length2 = (b - a).squaredNorm();
    offer(length2 > 0 ? Vec3(a + std::clamp((at - a).dot(b - a) / length2, 0.0, 1.0) * (b - a)) : a, (b - a).normalized());
  }
  return best;
}

/// Puts into every corner where large parts meet the vertex near it that takes it best.
bool meet_corners(TetEditor& mesh, const Parts& parts, double floor_quality) {
  std::vector<Index> outer;
  for (std::size_t v = 0; v < mesh.x.size(); ++v)
    if (mesh.boundary[v] && !mesh.star[v].empty()) outer.push_back(static_cast<Index>(v));
  bool any = false;
  for (const auto& [corner, meeting] : parts.corners) {
    Index best = -1;
    double quality = 0;
    bool taken = false;
    for (const Index v : outer) {
      const double size = mesh.size_m[v], far = (mesh.x[v] - corner).norm();
      taken = far < 1e-9 * size;
      if (taken) break;
      const bool large =
          std::all_of(meeting.begin(), meeting.end(), [&](Index part) { return parts.area_m2[part] > 4 * size * size; });
      if (far > edge_reach * size || !large) continue;
      const double least = std::min(mesh.star_quality(v), floor_quality) - 1e-12;
      const double fresh = mesh.star_quality_at(v, corner, std::max(least, quality));
      if (fresh > std::max(least, quality)) best = v, quality = fresh;
    }
    if (taken || best < 0) continue;
    mesh.move(best, corner);
    any = true;
  }
  return any;
}

}  // namespace

SharpEdges::SharpEdges(const Solid& solid) : solid_(solid), parts_(std::make_unique<const Parts>(parts_of(solid))) {}
SharpEdges::~SharpEdges() = default;

bool SharpEdges::meet(TetEditor& mesh, double floor_quality) const {
  const Parts& parts = *parts_;
  const Solid& solid = solid_;
  if (parts.edges.empty()) return false;
  bool any = false;
  constexpr Index none = -1;
  for (int sweep = 0; sweep < 4; ++sweep) {
    std::vector<std::set<Index>> between(mesh.x.size());
    Index hint = -1;
    for (const auto& t : mesh.all_boundary_triangles()) {
      const Vec3 a = mesh.x[t[0]], b = mesh.x[t[1]], c = mesh.x[t[2]];
      const double size = (mesh.size_m[t[0]] + mesh.size_m[t[1]] + mesh.size_m[t[2]]) / 3;
      const ClosestPoint q = solid.closest((a + b + c) / 3, hint);
      hint = q.triangle;
      const bool along = (b - a).cross(c - a).normalized().dot(solid.normal(q.triangle)) > 0.5;
      const bool near =
          q.squared_distance_m2<0.25 * size * size, large = parts.area_m2[parts.of[q.triangle]]> 4 * size * size;
      for (const Index v : t) between[v].insert(along && near && large ? parts.of[q.triangle] : none);
    }
    bool moved = meet_corners(mesh, parts, floor_quality);
    for (std::size_t v = 0; v < mesh.x.size(); ++v) {
      if (between[v].size() < 2 || between[v].count(none) > 0) continue;
      const auto id = static_cast<Index>(v);
      const double size = mesh.size_m[v];
      const auto place = place_of(mesh.x[v], between[v], parts, edge_reach * size);
      if (!place || (place->at - mesh.x[v]).norm() < 1e-3 * size) continue;
      const double least = std::min(mesh.star_quality(id), floor_quality) - 1e-12;
      const auto move = [&](const Vec3& there) {
        mesh.move(id, there);
        moved = true;
      };
      if (mesh.star_quality_at(id, place->at, least) > least) {
        move(place->at);
        continue;
      }
      // Neighbours on the edge may stand in the way: there is room further along it, or part of the way.
      std::optional<Vec3> best;
      double quality = least;
      for (const double slide : {-0.15, 0.15, -0.3, 0.3, -0.45, 0.45}) {
        const auto other = place_of(place->at + slide * size * place->along, between[v], parts, 0.1 * size);
        if (!other) continue;
        const double fresh = mesh.star_quality_at(id, other->at, quality);
        if (fresh > quality) best = other->at, quality = fresh;
      }
      for (const double share : {0.75, 0.5, 0.25, 0.12}) {
        if (best) break;
        const Vec3 there = mesh.x[v] + share * (place->at - mesh.x[v]);
        if (mesh.star_quality_at(id, there, least) > least) best = there;
      }
      if (best) move(*best);
    }
    if (!moved) break;
    any = true;
  }
  return any;
}

}  // namespace palpate::geometry
