// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/box_rims.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/union_find.hpp"

namespace palpate::geometry {
namespace {

constexpr double rim_share = 0.12;  // of the root of the area that a rim goes around, as a circle of its length
constexpr double hardly_a_rim = 0.05;  // of the longest: where a foot only grazes a side, or a scan is rough there

/// Where a triangle goes through one side of the box.
struct Piece {
  Vec3 from_m, to_m;
  double length_m() const { return (to_m - from_m).norm(); }
};

/// What of it lies in the box.
std::optional<Piece> within(const Vec3& low, const Vec3& high, Piece piece) {
  const Vec3 way = piece.to_m - piece.from_m, start = piece.from_m;
  double from = 0, to = 1;
  for (int k = 0; k < 3; ++k) {
    if (way(k) == 0) {
      if (start(k) < low(k) || start(k) > high(k)) return {};
      continue;
    }
    const double a = (low(k) - start(k)) / way(k), b = (high(k) - start(k)) / way(k);
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  if (from >= to) return {};
  if (from > 0) piece.from_m = start + from * way;  // else to the last digit, by which the next triangle knows it
  if (to < 1) piece.to_m = start + to * way;
  return piece;
}

/// Pieces of all sides, and which of them hang together.
class Rims {
 public:
  Rims(const Vec3& low, const Vec3& high, const TriMesh& surface) {
    for (Index t = 0; t < surface.triangles.rows(); ++t) {
      const std::size_t first = pieces_.size();
      for (int axis = 0; axis < 3; ++axis)
        for (const double at : {low(axis), high(axis)}) cut(surface, t, axis, at, low, high);
      meet_in_triangle(first);
    }
  }
  /// Without what is hardly one.
  std::vector<std::vector<Piece>> all() const {
    UnionFind together(Eigen::Index(pieces_.size()));
    for (const auto& [a, b] : joined_) together.join(a, b);
    std::map<Index, std::vector<Piece>> rims;
    for (std::size_t k = 0; k < pieces_.size(); ++k) rims[together.root(Eigen::Index(k))].push_back(pieces_[k]);
    double longest_m = 0;
    for (const auto& [root, rim] : rims) longest_m = std::max(longest_m, length_m(rim));
    std::vector<std::vector<Piece>> kept;
    for (auto& [root, rim] : rims)
      if (length_m(rim) > hardly_a_rim * longest_m) kept.push_back(std::move(rim));
    return kept;
  }
  static double length_m(const std::vector<Piece>& rim) {
    double sum = 0;
    for (const Piece& piece : rim) sum += piece.length_m();
    return sum;
  }

 private:
  // A side is told by its axis and its place; a rim goes on in the triangle beyond the edge through which it leaves this one.
  void cut(const TriMesh& surface, Index t, int axis, double at, const Vec3& low, const Vec3& high) {
    std::vector<std::pair<Vec3, std::pair<Index, Index>>> ends;
    for (int k = 0; k < 3; ++k) {
      Index i = surface.triangles(t, k), j = surface.triangles(t, (k + 1) % 3);
      if (j < i) std::swap(i, j);
      const Vec3 a = surface.vertices_m.row(i), b = surface.vertices_m.row(j);
      if ((a(axis) < at) == (b(axis) < at)) continue;
      Vec3 end = a + (at - a(axis)) / (b(axis) - a(axis)) * (b - a);
      end(axis) = at;
      ends.push_back({end, {i, j}});
    }
    if (ends.size() != 2) return;
    const auto piece = within(low, high, {ends[0].first, ends[1].first});
    if (!piece || !(piece->length_m() > 0)) return;
    const Index known = Index(pieces_.size());
    pieces_.push_back(*piece);
    for (const auto& [end, edge] : ends) {
      if (end != piece->from_m && end != piece->to_m) continue;  // cut off before
      const auto [there, fresh] = through_.try_emplace({axis, at, edge}, known);
      if (!fresh) joined_.emplace_back(there->second, known);
    }
  }
  // Around an edge of the box, from one side to the next.
  void meet_in_triangle(std::size_t first) {
    for (std::size_t a = first; a < pieces_.size(); ++a)
      for (std::size_t b = a + 1; b < pieces_.size(); ++b) {
        const Piece &p = pieces_[a], &q = pieces_[b];
        const double near_m = 1e-6 * std::max(p.length_m(), q.length_m());
        for (const Vec3& end : {p.from_m, p.to_m})
          if (std::min((end - q.from_m).norm(), (end - q.to_m).norm()) < near_m) joined_.emplace_back(Index(a), Index(b));
      }
  }

  std::vector<Piece> pieces_;
  std::map<std::tuple<int, double, std::pair<Index, Index>>, Index> through_;
  std::vector<std::pair<Index, Index>> joined_;
};

}  // namespace

std::vector<FinerNear> finer_at_rims(const Vec3& box_min_m, const Vec3& box_max_m, const TriMesh& surface) {
  std::vector<FinerNear> finer;
  for (const std::vector<Piece>& rim : Rims(box_min_m, box_max_m, weld(surface)).all()) {
    const double edge_m = rim_share * Rims::length_m(rim) / (2 * std::sqrt(EIGEN_PI));
    const std::size_t first = finer.size();
    for (const Piece& piece : rim) {
      const int steps = 1 + int(piece.length_m() / (0.7 * edge_m));
      for (int k = 0; k <= steps; ++k) {
        const Vec3 at = piece.from_m + double(k) / steps * (piece.to_m - piece.from_m);
        const bool known = std::any_of(finer.begin() + std::ptrdiff_t(first), finer.end(),
                                       [&](const auto& one) { return (one.point_m - at).norm() < 0.7 * edge_m; });
        if (!known) finer.push_back({at, 0.7 * edge_m, edge_m});
      }
    }
  }
  return finer;
}

}  // namespace palpate::geometry
