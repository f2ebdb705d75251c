// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/tet_coarsen.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <queue>

namespace palpate::geometry {
namespace {

// Cost is a squared distance. Edges cost this share of their length on top of what they cost the surface, so that flat and
// inner parts coarsen evenly.
constexpr double boundary_share = 0.06, inner_share = 0.05;

/// Area-weighted sum of squared distances from planes.
struct Quadric {
  Mat3 a = Mat3::Zero();
  Vec3 b = Vec3::Zero();
  double c = 0, area = 0;
  Quadric& operator+=(const Quadric& o) {
    a += o.a, b += o.b, c += o.c, area += o.area;
    return *this;
  }
  double mean(const Vec3& p) const { return area > 0 ? std::max(0.0, p.dot(a * p) + 2 * b.dot(p) + c) / area : 0; }
};

Quadric plane(const Vec3& normal, const Vec3& point, double area) {
  const double d = -normal.dot(point);
  return {area * normal * normal.transpose(), area * d * normal, area * d * d, area};
}

class Coarsener {
 public:
  Coarsener(TetEditor& mesh, const Solid& solid, const SurfaceSamples& samples, const CoarsenOptions& options)
      : m_(mesh), solid_(solid), o_(options), quadric_(mesh.x.size()), stamp_(mesh.x.size(), 0) {
    origin_ = 0.5 * (solid.min_m() + solid.max_m());
    // planes of the mesh's own triangles, and of the true surface, which knows of edges that the mesh cuts off
    const auto triangles = m_.all_boundary_triangles();
    TriMesh boundary;
    boundary.vertices_m.resize(static_cast<Eigen::Index>(m_.x.size()), 3);
    for (std::size_t v = 0; v < m_.x.size(); ++v) boundary.vertices_m.row(v) = m_.x[v].transpose();
    boundary.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      const auto& t = triangles[i];
      boundary.triangles.row(i) << t[0], t[1], t[2];
      const Vec3 n2 = (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0]));
      const double twice = n2.norm();
      if (!(twice > 0)) continue;
      const Quadric q = plane(n2 / twice, at(t[0]), twice / 6);
      for (const Index v : t) quadric_[v] += q;
    }
    const TriangleTree tree(boundary);
    for (std::size_t i = 0; i < samples.evenly; ++i) {
      const ClosestPoint c = tree.closest(samples.point[i]);
      const auto& t = triangles[c.triangle];
      if (c.squared_distance_m2 > std::pow(m_.size_m[t[0]], 2)) continue;
      for (int k = 0; k < 3; ++k)
        quadric_[t[k]] += plane(samples.normal[i], samples.point[i] - origin_, c.barycentric[k] * samples.area_each_m2);
    }
    std::fill(m_.drift_m.begin(), m_.drift_m.end(), 0.0);
  }

  void run() {
    double limit = o_.tolerance_m;
    const double most = 11.4 * limit;  // six times 1.5
    volume_m3_ = m_.volume_m3();
    if (o_.wall_m > 0) limit = std::min(limit, 0.2 * o_.wall_m);
    for (; limit < most && m_.count() > o_.tetrahedra && keeps_volume(); limit *= 1.5)
      while (m_.count() > o_.tetrahedra && keeps_volume())
        if (sweep(limit) < m_.count() / 100 + 1) break;
  }

 private:
  struct Entry {
    double cost;
    Index gone, kept;
    std::uint32_t stamp_gone, stamp_kept;
    bool operator<(const Entry& o) const {  // cheapest on top, ties by number
      return std::tie(cost, gone, kept) > std::tie(o.cost, o.gone, o.kept);
    }
  };

  Vec3 at(Index v) const { return m_.x[v] - origin_; }

  bool keeps_volume() const { return o_.wall_m <= 0 || std::abs(m_.volume_m3() / volume_m3_ - 1) < 0.03; }

  double cost(Index gone, Index kept) const {
    const double length2 = (m_.x[gone] - m_.x[kept]).squaredNorm();
    const double share = m_.boundary[gone] ? boundary_share : inner_share;
    double c = share * share * length2;
    if (m_.boundary[gone]) {
      Quadric q = quadric_[gone];
      q += quadric_[kept];
      c += q.mean(at(kept));
    }
    if (o_.edge_m) {
      const double wished = o_.edge_m(m_.x[gone]);
      if (length2 > 0.25 * wished * wished) c *= 1 + 1e6 * length2 / (wished * wished);
    }
    return c;
  }

  void push(Index gone, Index kept) {
    if (m_.boundary[gone] && !m_.boundary[kept]) return;
    heap_.push({cost(gone, kept), gone, kept, stamp_[gone], stamp_[kept]});
  }

  /// One run over the edges; returns how many were merged.
  Index sweep(double limit) {
    heap_ = {};
    for (Index v = 0; v < static_cast<Index>(m_.x.size()); ++v)
      if (!m_.star[v].empty())
        for (const Index w : m_.neighbours(v)) push(v, w);
    Index merged = 0;
    const auto accept = [&](const std::vector<TetEditor::Tri>& before, const std::vector<TetEditor::Tri>& after) {
      return near(before, after, limit);
    };
    while (!heap_.empty() && m_.count() > o_.tetrahedra) {
      const Entry e = heap_.top();
      heap_.pop();
      if (e.cost > 9 * limit * limit && !o_.edge_m) break;  // what is left is refused anyway, or comes with the next limit
      if (stamp_[e.gone] != e.stamp_gone || stamp_[e.kept] != e.stamp_kept || m_.star[e.gone].empty()) continue;
      const double above = std::min(0.12, m_.star_quality(e.gone));
      if (!m_.collapse(e.gone, e.kept, above, accept, limit)) continue;
      ++merged;
      quadric_[e.kept] += quadric_[e.gone];
      ++stamp_[e.kept];
      for (const Index w : m_.neighbours(e.kept)) push(e.kept, w), push(w, e.kept);
    }
    return merged;
  }

  bool near(const std::vector<TetEditor::Tri>& before, const std::vector<TetEditor::Tri>& after, double limit) const {
    const auto& x = m_.x;
    const auto normal = [&](const TetEditor::Tri& t) { return Vec3((x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]])); };
    double was = 0;
    Index hint = -1;
    if (!solid_.watertight())  // over a hole the surface is nowhere near
      for (const auto& t : before) {
        const ClosestPoint c = solid_.closest((x[t[0]] + x[t[1]] + x[t[2]]) / 3, hint);
        hint = c.triangle;
        was = std::max(was, c.squared_distance_m2);
      }
    const double allowed2 = std::max(limit * limit, was);
    for (const auto& t : after) {
      const Vec3 n = normal(t);
      const double area = n.norm();
      if (!(area > 0)) return false;
      double facing = -1;
      for (const auto& b : before) {
        const Vec3 nb = normal(b);
        facing = std::max(facing, nb.dot(n) / (nb.norm() * area));
      }
      if (!(facing > 0.3)) return false;
      const ClosestPoint c = solid_.closest((x[t[0]] + x[t[1]] + x[t[2]]) / 3, hint);
      hint = c.triangle;
      if (c.squared_distance_m2 > allowed2) return false;
      // the edge across the merged vertex; the other two are its neighbours'
      const Vec3 far = 0.5 * (x[t[0]] + x[t[1]]);
      if (solid_.closest(far, hint).squared_distance_m2 > allowed2) return false;
    }
    return true;
  }

  TetEditor& m_;
  const Solid& solid_;
  CoarsenOptions o_;
  Vec3 origin_;
  double volume_m3_ = 0;  ///< at first
  std::vector<Quadric> quadric_;
  std::vector<std::uint32_t> stamp_;
  std::priority_queue<Entry> heap_;
};

}  // namespace

void coarsen(TetEditor& mesh, const Solid& solid, const SurfaceSamples& samples, const CoarsenOptions& options) {
  Coarsener(mesh, solid, samples, options).run();
  mesh.measure_sizes();  // what follows measures itself by the edges that are there now
}

}  // namespace palpate::geometry
