// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/tet_improve.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>

#include "palpate/geometry/surface_fit.hpp"
#include "palpate/geometry/tet_quality.hpp"

namespace palpate::geometry {
namespace {

/// Lets a change of the boundary pass when the new triangles stay near the surface and do not fold.
TetEditor::Accept near_surface(const TetEditor& mesh, const Solid& solid, double tolerance) {
  return [&mesh, &solid, tolerance](const std::vector<TetEditor::Tri>& before, const std::vector<TetEditor::Tri>& after) {
    const auto& x = mesh.x;
    const auto normal = [&](const TetEditor::Tri& t) { return Vec3((x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]])); };
    double size = 0;
    for (const auto& t : before) size += mesh.size_m[t[0]] / double(before.size());
    double allowed2 = std::pow(mesh.allowed_m(tolerance, size), 2);
    bool widened = false;
    Index hint = -1;
    // as far as it was already is near enough; asked for only when it matters
    const auto near = [&](const Vec3& p) {
      if (solid.within(p, allowed2, hint)) return true;
      if (std::exchange(widened, true)) return false;
      for (const auto& t : before) {
        const ClosestPoint c = solid.closest((x[t[0]] + x[t[1]] + x[t[2]]) / 3, hint);
        allowed2 = std::max(allowed2, c.squared_distance_m2);
      }
      return solid.within(p, allowed2, hint);
    };
    for (const auto& t : after) {
      const Vec3 n = normal(t), middle = (x[t[0]] + x[t[1]] + x[t[2]]) / 3;
      const ClosestPoint c = solid.closest(middle, hint);
      hint = c.triangle;
      if (c.squared_distance_m2 > allowed2 && !near(middle)) return false;
      if (c.squared_distance_m2 < 0.09 * size * size && solid.normal(c.triangle).dot(n) < 0.3 * n.norm()) return false;
      for (int k = 0; k < 3; ++k)
        if (!near(0.5 * (x[t[k]] + x[t[(k + 1) % 3]]))) return false;
      bool folds = true;
      for (const auto& b : before) {
        const Vec3 nb = normal(b);
        folds = folds && nb.dot(n) < 0.3 * nb.norm() * n.norm();
      }
      if (folds) return false;
    }
    return true;
  };
}

class Improver {
 public:
  Improver(TetEditor& mesh, const Solid& solid, const SurfaceSamples& samples, const ImproveOptions& options)
      : m_(mesh),
        solid_(solid),
        samples_(samples),
        o_(options),
        accept_(near_surface(mesh, solid, options.tolerance)),
        tolerance_(options.tolerance) {}

  bool run(const OnProgress& progress) {
    for (int round = 0; round < o_.most_rounds; ++round) {
      if (progress && !progress("quality", double(round) / o_.most_rounds)) return false;
      const double floor = std::min(o_.target_quality, 0.2 + 0.04 * round);
      if (round < 2 || round % 2 == 0) fit_to_surface(m_, solid_, samples_, floor);
      const double below = round < 2 ? 0.62 : o_.target_quality + (round < 6 ? 0.08 : 0.03);
      swap(below);
      smooth(below);
      if (round % 2 == 1) merge(o_.target_quality);
      smooth(below);
      if (round > 3 && worst() >= o_.target_quality) break;
    }
    for (int round = 0; round < 12 && worst() < (round < 8 ? o_.target_quality : usable); ++round) {
      off_surface_ = round > 1;
      if (round >= 8) {  // better a little off the surface than an element that spoils the stiffness matrix
        tolerance_ *= 1.4;
        accept_ = near_surface(m_, solid_, tolerance_);
      }
      insert(o_.target_quality);
      swap(o_.target_quality);
      smooth(o_.target_quality);
      merge(o_.target_quality);
      smooth(o_.target_quality);
    }
    return true;
  }

  double worst() const {
    double q = 1;
    for (std::size_t t = 0; t < m_.tets.size(); ++t)
      if (m_.alive[t]) q = std::min(q, m_.quality[t]);
    return q;
  }

 private:
  static constexpr double usable = 0.3;  ///< 17.5 and 134 degrees

  std::vector<Index> worse_than(double q) const {
    std::vector<Index> out;
    for (std::size_t t = 0; t < m_.tets.size(); ++t)
      if (m_.alive[t] && m_.quality[t] < q) out.push_back(static_cast<Index>(t));
    std::sort(out.begin(), out.end(),
              [&](Index a, Index b) { return m_.quality[a] != m_.quality[b] ? m_.quality[a] < m_.quality[b] : a < b; });
    return out;
  }

  void swap(double below) {
    for (const Index t : worse_than(below)) {
      if (!m_.alive[t] || m_.quality[t] >= below) continue;
      const TetEditor::Tet tet = m_.tets[t];
      bool done = false;
      for (int i = 0; i < 4 && !done; ++i)
        for (int j = i + 1; j < 4 && !done; ++j) done = m_.remove_edge(tet[i], tet[j], accept_);
      for (int k = 0; k < 4 && !done; ++k) done = m_.remove_face(t, k);
    }
  }

  void merge(double below) {
    for (const Index t : worse_than(below)) {
      if (!m_.alive[t] || m_.quality[t] >= below) continue;
      const TetEditor::Tet tet = m_.tets[t];
      std::array<std::array<Index, 2>, 12> edges;
      int n = 0;
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
          if (i != j) edges[n++] = {tet[i], tet[j]};
      std::sort(edges.begin(), edges.end(), [&](const auto& a, const auto& b) {
        return (m_.x[a[0]] - m_.x[a[1]]).squaredNorm() < (m_.x[b[0]] - m_.x[b[1]]).squaredNorm();
      });
      for (const auto& [gone, kept] : edges)
        if (m_.collapse(gone, kept, std::min(below, m_.star_quality(gone) + 1e-6), accept_, drift(gone, kept))) break;
    }
  }

  double drift(Index a, Index b) const { return m_.allowed_m(tolerance_, std::min(m_.size_m[a], m_.size_m[b])); }

  /// Splits an edge of a bad element where the new vertex, well placed, leaves only better ones.
  void insert(double below) {
    for (const Index t : worse_than(below)) {
      if (!m_.alive[t] || m_.quality[t] >= below) continue;
      const TetEditor::Tet tet = m_.tets[t];
      bool done = false;
      for (int i = 0; i < 4 && !done; ++i)
        for (int j = i + 1; j < 4 && !done; ++j) {
          double old = 1;
          for (const Index e : m_.edge_tets(tet[i], tet[j])) old = std::min(old, m_.quality[e]);
          const Index v = m_.split_edge(tet[i], tet[j]);
          smooth_vertex(v);
          done = m_.star_quality(v) > old + 0.01;
          if (!done) m_.unsplit_edge(v, tet[i], tet[j]);
        }
    }
  }

  void smooth(double below) {
    std::vector<Index> pending;
    for (std::size_t v = 0; v < m_.x.size(); ++v)
      if (!m_.star[v].empty() && m_.star_quality(static_cast<Index>(v)) < below) pending.push_back(static_cast<Index>(v));
    for (const Index v : pending) smooth_vertex(v);
  }

  /// Gradient by differences of the soft minimum of the star's quality; elements well above the worst weigh nothing in it.
  Vec3 gradient(Index v, double worst, double h) const {
    constexpr double sharpness = 25, reach = 0.16;
    Vec3 g = Vec3::Zero();
    double sum = 0;
    for (const Index id : m_.star[v]) {
      const double here = m_.quality[id];
      if (here > worst + reach) continue;
      const double weight = std::exp(-sharpness * (here - worst));
      sum += weight;
      const TetEditor::Tet& t = m_.tets[id];
      std::array<Vec3, 4> p;
      int place = 0;
      for (int k = 0; k < 4; ++k) {
        p[k] = m_.x[t[k]];
        if (t[k] == v) place = k;
      }
      for (int k = 0; k < 3; ++k) {
        p[place][k] += h;
        g[k] += weight * (tet_quality(p[0], p[1], p[2], p[3]) - here) / h;
        p[place][k] -= h;
      }
    }
    return g / sum;
  }

  void smooth_vertex(Index v) {
    const bool outer = m_.boundary[v];
    double q = m_.star_quality(v);
    Vec3 normal = Vec3::Zero();
    ClosestPoint foot;
    Vec3 offset = Vec3::Zero();
    bool on_surface = false;
    Around around;
    if (outer) {
      normal = m_.boundary_normal(v);
      if (normal.isZero(0)) return;
      foot = solid_.closest(m_.x[v]);
      offset = m_.x[v] - foot.point_m;
      on_surface = offset.norm() < 0.3 * m_.size_m[v] && std::abs(solid_.normal(foot.triangle).dot(normal)) > 0.3;
    }
    const double h = 1e-4 * m_.size_m[v];
    for (int step = 0; step < 3; ++step) {
      Vec3 g = gradient(v, q, h);
      if (outer && !off_surface_) g -= g.dot(normal) * normal;
      const double slope = g.norm();
      if (!(slope > 1e-9)) break;
      const Vec3 d = g / slope;
      bool moved = false;
      for (double length = 0.25 * m_.size_m[v]; length > 0.01 * m_.size_m[v]; length *= 0.45) {
        Vec3 to = m_.x[v] + length * d;
        if (outer && on_surface && !off_surface_) {
          const ClosestPoint c = solid_.closest(to, foot.triangle);
          const double keep = offset.dot(normal);
          to = c.point_m + keep * normal;
        }
        const double fresh = m_.star_quality_at(v, to, q);
        if (fresh > q + 1e-4) {
          if (outer && !stays_near(v, to, foot.triangle, around)) continue;
          m_.move(v, to);
          q = fresh;
          moved = true;
          break;
        }
      }
      if (!moved) break;
    }
    if (!off_surface_ || q >= o_.target_quality) return;
    // where the worst elements pull in several directions the gradient is blind
    double reach = 0.15 * m_.size_m[v];
    for (int i = 0; i < 24; ++i, reach *= 0.93) {
      const Vec3 to = m_.x[v] + reach * Vec3(uniform_(rng_), uniform_(rng_), uniform_(rng_));
      const double fresh = m_.star_quality_at(v, to, q);
      if (fresh <= q + 1e-4 || (outer && !stays_near(v, to, foot.triangle, around))) continue;
      m_.move(v, to);
      q = fresh;
    }
  }

  /// The boundary triangles around a vertex that moves, and the largest squared distance of their middles at first.
  struct Around {
    std::vector<TetEditor::Tri> triangles;
    double farthest2 = -1;
  };

  /// That distance must not grow noticeably.
  bool stays_near(Index v, const Vec3& to, Index hint, Around& around) const {
    const double allowed = (off_surface_ ? tolerance_ : 0.04) * m_.size_m[v], allowed2 = allowed * allowed;
    // (a vertex over a hole is far from every triangle already)
    if (off_surface_ && !solid_.within(to, allowed2, hint) && solid_.within(m_.x[v], 4 * allowed2, hint)) return false;
    const auto middle = [&](const TetEditor::Tri& t, const Vec3& at) { return Vec3((at + m_.x[t[1]] + m_.x[t[2]]) / 3); };
    if (around.triangles.empty()) around.triangles = m_.boundary_triangles(v);
    for (const auto& t : around.triangles) {
      const Vec3 p = middle(t, to);
      if (solid_.within(p, around.farthest2 < 0 ? allowed2 : std::max(1.02 * around.farthest2, allowed2), hint)) continue;
      if (around.farthest2 >= 0) return false;
      for (const auto& b : around.triangles)
        around.farthest2 = std::max(around.farthest2, solid_.closest(middle(b, m_.x[v]), hint).squared_distance_m2);
      if (!solid_.within(p, std::max(1.02 * around.farthest2, allowed2), hint)) return false;
    }
    return true;
  }

  TetEditor& m_;
  const Solid& solid_;
  const SurfaceSamples& samples_;
  ImproveOptions o_;
  TetEditor::Accept accept_;
  std::mt19937 rng_{1};
  std::uniform_real_distribution<double> uniform_{-1, 1};
  double tolerance_;
  bool off_surface_ = false;  ///< boundary vertices may leave the surface within the tolerance
};

}  // namespace

void merge_short_edges(TetEditor& mesh, const Solid& solid, double share, double above_quality) {
  const auto accept = near_surface(mesh, solid, 0.12);
  struct Short {
    double ratio;
    Index a, b;
  };
  for (int pass = 0; pass < 3; ++pass) {
    std::vector<Short> list;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
      if (!mesh.alive[t]) continue;
      for (int i = 0; i < 4; ++i)
        for (int j = i + 1; j < 4; ++j) {
          const Index a = std::min(mesh.tets[t][i], mesh.tets[t][j]), b = std::max(mesh.tets[t][i], mesh.tets[t][j]);
          const double ratio = (mesh.x[a] - mesh.x[b]).norm() / std::min(mesh.size_m[a], mesh.size_m[b]);
          if (ratio < share) list.push_back({ratio, a, b});
        }
    }
    std::sort(list.begin(), list.end(),
              [](const Short& p, const Short& q) { return std::tie(p.ratio, p.a, p.b) < std::tie(q.ratio, q.a, q.b); });
    list.erase(
        std::unique(list.begin(), list.end(), [](const Short& p, const Short& q) { return p.a == q.a && p.b == q.b; }),
        list.end());
    int merged = 0;
    for (const Short& s : list) {
      if (mesh.star[s.a].empty() || mesh.star[s.b].empty() || mesh.edge_tets(s.a, s.b).empty()) continue;
      for (const auto& [gone, kept] : {std::pair{s.a, s.b}, std::pair{s.b, s.a}}) {
        if (mesh.boundary[gone] && !mesh.boundary[kept]) continue;
        const double above = std::min(above_quality, mesh.star_quality(gone));
        const double drift = mesh.allowed_m(0.12, std::min(mesh.size_m[gone], mesh.size_m[kept]));
        if (mesh.collapse(gone, kept, above, accept, drift)) {
          ++merged;
          break;
        }
      }
    }
    if (merged == 0) break;
  }
}

bool improve(TetEditor& mesh, const Solid& solid, const SurfaceSamples& samples, const ImproveOptions& options,
             const OnProgress& progress) {
  return Improver(mesh, solid, samples, options).run(progress);
}

}  // namespace palpate::geometry
