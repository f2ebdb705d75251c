// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/subdivide.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace palpate::geometry {
namespace {

constexpr std::size_t most_triangles = 60000;  // that are cut further
using Corners = std::array<Index, 3>;

class Splitter {
 public:
  explicit Splitter(const TriMesh& surface) {
    for (Index v = 0; v < surface.vertices_m.rows(); ++v) points_.emplace_back(surface.vertices_m.row(v));
    for (Index t = 0; t < surface.triangles.rows(); ++t)
      triangles_.push_back({surface.triangles(t, 0), surface.triangles(t, 1), surface.triangles(t, 2)});
  }

  /// One round: every edge is halved once at most. False when none was too long.
  bool halve(const std::function<double(const Vec3&)>& edge_m) {
    middle_.clear();
    const std::size_t count = triangles_.size();
    std::vector<int> longest(count);
    for (std::size_t t = 0; t < count; ++t) {
      longest[t] = longest_of(triangles_[t]);
      const auto [a, b] = edge(triangles_[t], longest[t]);
      if (length_m(a, b) > edge_m(0.5 * (points_[a] + points_[b]))) mark(triangles_[t], longest[t]);
    }
    if (middle_.empty()) return false;
    // A triangle that is cut is cut along its longest edge first, which its neighbour there must know.
    for (bool again = true; again;) {
      again = false;
      for (std::size_t t = 0; t < count; ++t) {
        if (!is_marked(triangles_[t], longest[t]) && (is_marked(triangles_[t], 0) || is_marked(triangles_[t], 1) || is_marked(triangles_[t], 2)))
          again = mark(triangles_[t], longest[t]);
      }
    }
    std::vector<Corners> cut;
    cut.reserve(2 * count);
    for (const Corners& t : triangles_) split(t, cut);
    triangles_ = std::move(cut);
    return true;
  }

  std::size_t count() const { return triangles_.size(); }

  TriMesh mesh() const {
    TriMesh out;
    out.vertices_m.resize(static_cast<Eigen::Index>(points_.size()), 3);
    for (std::size_t v = 0; v < points_.size(); ++v) out.vertices_m.row(static_cast<Eigen::Index>(v)) = points_[v];
    out.triangles.resize(static_cast<Eigen::Index>(triangles_.size()), 3);
    for (std::size_t t = 0; t < triangles_.size(); ++t)
      out.triangles.row(static_cast<Eigen::Index>(t)) << triangles_[t][0], triangles_[t][1], triangles_[t][2];
    return out;
  }

 private:
  struct Edge {
    std::size_t a, b;
  };
  static Edge edge(const Corners& t, int k) {
    const auto [a, b] = std::minmax(t[static_cast<std::size_t>(k)], t[static_cast<std::size_t>((k + 1) % 3)]);
    return {static_cast<std::size_t>(a), static_cast<std::size_t>(b)};
  }
  static std::uint64_t key(const Corners& t, int k) {
    const auto [a, b] = edge(t, k);
    return std::uint64_t{a} << 32 | b;
  }
  double length_m(std::size_t a, std::size_t b) const { return (points_[a] - points_[b]).norm(); }
  /// Ties go to the lower pair of corners, so that neighbours agree.
  int longest_of(const Corners& t) const {
    int best = 0;
    double longest = -1;
    for (int k = 0; k < 3; ++k) {
      const auto [a, b] = edge(t, k);
      const double length = length_m(a, b);
      if (length > longest * (1 + 1e-9) || (length > longest * (1 - 1e-9) && key(t, k) < key(t, best))) longest = length, best = k;
    }
    return best;
  }
  bool is_marked(const Corners& t, int k) const { return middle_.count(key(t, k)) > 0; }
  bool mark(const Corners& t, int k) {
    const auto [place, fresh] = middle_.emplace(key(t, k), static_cast<Index>(points_.size()));
    if (fresh) {
      const auto [a, b] = edge(t, k);
      points_.push_back(0.5 * (points_[a] + points_[b]));
    }
    return fresh;
  }
  void split(const Corners& t, std::vector<Corners>& out) const {
    int longest = -1;
    double length = -1;
    for (int k = 0; k < 3; ++k) {
      if (!is_marked(t, k)) continue;
      const auto [a, b] = edge(t, k);
      const double here = length_m(a, b);
      if (here > length * (1 + 1e-9) || (here > length * (1 - 1e-9) && key(t, k) < key(t, longest))) length = here, longest = k;
    }
    if (longest < 0) {
      out.push_back(t);
      return;
    }
    const auto k = static_cast<std::size_t>(longest);
    const Index a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3], middle = middle_.at(key(t, longest));
    split({a, middle, c}, out);
    split({middle, b, c}, out);
  }

  std::vector<Vec3> points_;
  std::vector<Corners> triangles_;
  std::unordered_map<std::uint64_t, Index> middle_;  // of the edges that are halved in this round
};

}  // namespace

TriMesh subdivided(TriMesh surface, const std::function<double(const Vec3&)>& edge_m) {
  Splitter splitter(surface);
  bool changed = false;
  while (splitter.count() <= most_triangles && splitter.halve(edge_m)) changed = true;
  return changed ? splitter.mesh() : surface;
}

}  // namespace palpate::geometry
