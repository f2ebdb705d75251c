// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/hole_covers.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <unordered_map>

#include "palpate/core/math.hpp"
#include "palpate/geometry/union_find.hpp"

namespace palpate::geometry {
namespace {

using Loop = std::vector<Index>;
using Tri = Eigen::Matrix<Index, 1, 3>;

constexpr double largest_share = 0.7;  // of a part's area that a lid may add: half a ball is closed, a flat patch is not

class HoleFinder {
 public:
  HoleFinder(const TriMesh& mesh, const std::vector<std::array<Index, 3>>& open)
      : m_(mesh), next_(mesh.vertices_m.rows()), parts_(mesh.vertices_m.rows()), area_(mesh.vertices_m.rows(), 0) {
    for (Index t = 0; t < m_.triangles.rows(); ++t)
      for (int k = 1; k < 3; ++k) parts_.join(m_.triangles(t, 0), m_.triangles(t, k));
    for (Index t = 0; t < m_.triangles.rows(); ++t)
      area_[parts_.root(m_.triangles(t, 0))] += area(m_.triangles(t, 0), m_.triangles(t, 1), m_.triangles(t, 2));
    for (const auto& [low, high, t] : open) {
      bool ascending = false;
      for (int k = 0; k < 3; ++k) ascending |= m_.triangles(t, k) == low && m_.triangles(t, (k + 1) % 3) == high;
      next_[ascending ? high : low].push_back(ascending ? low : high);
      starts_.push_back(ascending ? high : low);
    }
  }

  HoleCovers run() {
    // a loop that could also be walked as part of a longer one through the same corner is taken by itself
    for (const int most : {3, 4, 5, 6, 8, 12, 24, 60, 150})
      for (const Index v : starts_)
        for (bool again = true; again;) {
          again = false;
          for (const Index w : next_[v])
            if (const Loop loop = shortest(v, w, most); !loop.empty()) {
              cover(loop);
              again = true;
              break;
            }
        }
    return std::move(out_);
  }

 private:
  Vec3 at(Index v) const { return m_.vertices_m.row(v).transpose(); }
  double area(Index a, Index b, Index c) const { return 0.5 * (at(b) - at(a)).cross(at(c) - at(a)).norm(); }

  /// The fewest open edges that lead back to `from` over its edge to `first`; empty: none with at most `most`.
  Loop shortest(Index from, Index first, int most) const {
    std::vector<Index> visited{first};
    std::unordered_map<Index, Index> before{{first, from}};
    std::size_t level_end = 1;
    int length = 1;
    for (std::size_t i = 0; i < visited.size(); ++i) {
      if (i == level_end) level_end = visited.size(), ++length;
      if (length >= most) return {};
      for (const Index w : next_[visited[i]]) {
        if (w == from) {
          Loop out;
          for (Index v = visited[i]; v != from; v = before.at(v)) out.push_back(v);
          out.push_back(from);
          std::reverse(out.begin(), out.end());
          return out.size() >= 3 ? out : Loop{};
        }
        if (before.try_emplace(w, visited[i]).second) visited.push_back(w);
      }
    }
    return {};
  }

  /// Its edges are open no longer; what would be a lid over a part's own rim is left out.
  void cover(const Loop& loop) {
    const int n = static_cast<int>(loop.size());
    // best(i, j): least area over the polygon loop[i..j]
    std::vector<double> best(n * n, 0);
    std::vector<int> cut(n * n, -1);
    for (int span = 2; span < n; ++span)
      for (int i = 0; i + span < n; ++i) {
        const int j = i + span;
        best[i * n + j] = std::numeric_limits<double>::infinity();
        for (int k = i + 1; k < j; ++k) {
          const double a = best[i * n + k] + best[k * n + j] + area(loop[i], loop[k], loop[j]);
          if (a < best[i * n + j]) best[i * n + j] = a, cut[i * n + j] = k;
        }
      }
    const double lid = best[n - 1];
    double rim = 0;
    for (int i = 0; i < n; ++i) {
      auto& from = next_[loop[i]];
      from.erase(std::find(from.begin(), from.end(), loop[(i + 1) % n]));
      rim += (at(loop[i]) - at(loop[(i + 1) % n])).norm();
    }
    if (!(lid <= largest_share * area_[parts_.root(loop[0])])) return;
    std::vector<std::pair<int, int>> pending{{0, n - 1}};
    while (!pending.empty()) {
      const auto [i, j] = pending.back();
      pending.pop_back();
      if (j < i + 2) continue;
      const int k = cut[i * n + j];
      out_.triangles.push_back(Tri(loop[i], loop[k], loop[j]));
      out_.width_m.push_back(4 * lid / rim);
      pending.push_back({i, k});
      pending.push_back({k, j});
    }
  }

  const TriMesh& m_;
  std::vector<std::vector<Index>> next_;  ///< open edges, so directed that a lid's triangle runs along them
  UnionFind parts_;
  std::vector<double> area_;   ///< of a part, at its root
  std::vector<Index> starts_;  ///< of open edges
  HoleCovers out_;
};

}  // namespace

HoleCovers cover_holes(const TriMesh& mesh, const std::vector<std::array<Index, 3>>& open) {
  return open.empty() ? HoleCovers{} : HoleFinder(mesh, open).run();
}

}  // namespace palpate::geometry
