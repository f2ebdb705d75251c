// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/implicit_surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "palpate/core/error.hpp"

namespace palpate::lab {
namespace {

Vec3 gradient(const Implicit& body, const Vec3& p, double h) {
  Vec3 g;
  for (int k = 0; k < 3; ++k) g(k) = (body(p + h * Vec3::Unit(k)) - body(p - h * Vec3::Unit(k))) / (2 * h);
  return g;
}

class March {
 public:
  March(const Implicit& body, const ImplicitBox& box) : body_(body), box_(box) {
    const Vec3 extent = box.max_m - box.min_m;
    if (!(extent.minCoeff() > 0) || !(box.cell_m > 0)) throw Error("must not be empty", "ImplicitBox");
    for (int k = 0; k < 3; ++k) count_[std::size_t(k)] = Index(std::ceil(extent(k) / box.cell_m)) + 1;
    values_.resize(std::size_t(count_[0]) * std::size_t(count_[1]) * std::size_t(count_[2]));
    bool any = false;
    for (Index k = 0; k < count_[2]; ++k)
      for (Index j = 0; j < count_[1]; ++j)
        for (Index i = 0; i < count_[0]; ++i) {
          // A vertex exactly on the surface would make triangles without area: it counts as just outside.
          double value = body(point(node(i, j, k)));
          if (std::abs(value) < 1e-3 * box.cell_m) value = 1e-3 * box.cell_m;
          values_[std::size_t(node(i, j, k))] = value;
          if (value > 0) continue;
          any = true;
          if (i == 0 || j == 0 || i + 1 == count_[0] || j + 1 == count_[1] || k + 1 == count_[2])
            throw Error("the body reaches a side or the top of the box", "ImplicitBox");
        }
    if (!any) throw Error("the body is not in the box", "ImplicitBox");
  }

  TriMesh run() {
    for (Index k = 0; k + 1 < count_[2]; ++k)
      for (Index j = 0; j + 1 < count_[1]; ++j)
        for (Index i = 0; i + 1 < count_[0]; ++i) cell(i, j, k);
    for (Index j = 0; j + 1 < count_[1]; ++j)
      for (Index i = 0; i + 1 < count_[0]; ++i) {
        const Index a = node(i, j, 0), b = node(i + 1, j, 0), c = node(i + 1, j + 1, 0), d = node(i, j + 1, 0);
        cap({a, b, c});  // the diagonal is that of the tetrahedra above
        cap({a, c, d});
      }
    TriMesh mesh;
    mesh.vertices_m.resize(Eigen::Index(vertices_.size()), 3);
    for (std::size_t v = 0; v < vertices_.size(); ++v) mesh.vertices_m.row(Eigen::Index(v)) = vertices_[v];
    mesh.triangles.resize(Eigen::Index(triangles_.size()), 3);
    for (std::size_t t = 0; t < triangles_.size(); ++t)
      mesh.triangles.row(Eigen::Index(t)) << triangles_[t][0], triangles_[t][1], triangles_[t][2];
    return mesh;
  }

 private:
  Index node(Index i, Index j, Index k) const { return (k * count_[1] + j) * count_[0] + i; }
  Vec3 point(Index n) const {
    const Index i = n % count_[0], j = n / count_[0] % count_[1], k = n / count_[0] / count_[1];
    return box_.min_m + box_.cell_m * Vec3(i, j, k);
  }
  double value(Index n) const { return values_[std::size_t(n)]; }
  bool on_bottom(Index n) const { return n < count_[0] * count_[1]; }

  Index add(const Vec3& p, const Vec3& on_edge) {
    vertices_.push_back(p);
    on_edges_.push_back(on_edge);
    return Index(vertices_.size()) - 1;
  }
  // The grid node itself, where it is a corner of the cap.
  Index corner(Index n) {
    const auto [it, fresh] = corner_of_.emplace(n, Index(0));
    if (fresh) it->second = add(point(n), point(n));
    return it->second;
  }
  // Where the surface crosses the edge between two nodes, moved onto the zero set (within the bottom plane on its edges).
  Index crossing(Index a, Index b) {
    const auto [it, fresh] = crossing_of_.emplace(std::minmax(a, b), Index(0));
    if (!fresh) return it->second;
    const double share = value(a) / (value(a) - value(b));
    const Vec3 start = (1 - share) * point(a) + share * point(b);
    Vec3 p = start;
    const bool flat = on_bottom(a) && on_bottom(b);
    for (int step = 0; step < 3; ++step) {
      Vec3 g = gradient(body_, p, 1e-3 * box_.cell_m);
      if (flat) g.z() = 0;
      if (g.squaredNorm() > 1e-6) p -= body_(p) / g.squaredNorm() * g;
    }
    p.z() = std::max(p.z(), box_.min_m.z());
    it->second = add((p - start).norm() < 0.5 * box_.cell_m && p.allFinite() ? p : start, start);
    return it->second;
  }

  void triangle(Index a, Index b, Index c) { triangles_.push_back({a, b, c}); }

  void cell(Index i, Index j, Index k) {
    static constexpr std::array<std::array<int, 3>, 6> orders{{{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}}};
    for (const auto& order : orders) {
      std::array<Index, 3> at{0, 0, 0};
      std::array<Index, 4> n{};
      for (int c = 0; c < 4; ++c) {
        n[std::size_t(c)] = node(i + at[0], j + at[1], k + at[2]);
        if (c < 3) at[std::size_t(order[std::size_t(c)])] = 1;
      }
      std::vector<Index> in, out;
      for (const Index v : n) (value(v) < 0 ? in : out).push_back(v);
      if (in.empty() || out.empty()) continue;
      const std::size_t first = triangles_.size();
      if (in.size() == 1 || out.size() == 1) {
        const Index one = in.size() == 1 ? in[0] : out[0];
        const auto& others = in.size() == 1 ? out : in;
        triangle(crossing(one, others[0]), crossing(one, others[1]), crossing(one, others[2]));
      } else {
        const Index p = crossing(in[0], out[0]), q = crossing(in[0], out[1]), r = crossing(in[1], out[1]),
                    s = crossing(in[1], out[0]);
        triangle(p, q, r);
        triangle(p, r, s);
      }
      // Outward: from the inner nodes to the outer ones, before the crossings were moved (that may turn a tiny triangle).
      Vec3 outward = Vec3::Zero();
      for (const Index v : out) outward += point(v) / double(out.size());
      for (const Index v : in) outward -= point(v) / double(in.size());
      for (std::size_t t = first; t < triangles_.size(); ++t) {
        auto& tri = triangles_[t];
        const Vec3 a = on_edges_[std::size_t(tri[0])];
        const Vec3 normal = (on_edges_[std::size_t(tri[1])] - a).cross(on_edges_[std::size_t(tri[2])] - a);
        if (normal.dot(outward) < 0) std::swap(tri[1], tri[2]);
      }
    }
  }

  // The part of a triangle of the bottom that lies inside the body, facing down. Its corners run counter-clockwise from above.
  void cap(const std::array<Index, 3>& n) {
    std::vector<Index> polygon;
    for (std::size_t c = 0; c < 3; ++c) {
      const Index a = n[c], b = n[(c + 1) % 3];
      if (value(a) < 0) polygon.push_back(corner(a));
      if ((value(a) < 0) != (value(b) < 0)) polygon.push_back(crossing(a, b));
    }
    for (std::size_t c = 2; c < polygon.size(); ++c) triangle(polygon[0], polygon[c], polygon[c - 1]);
  }

  const Implicit& body_;
  ImplicitBox box_;
  std::array<Index, 3> count_{};
  std::vector<double> values_;
  std::vector<Vec3> vertices_, on_edges_;
  std::vector<std::array<Index, 3>> triangles_;
  std::map<Index, Index> corner_of_;
  std::map<std::pair<Index, Index>, Index> crossing_of_;
};

}  // namespace

TriMesh implicit_surface(const Implicit& body, const ImplicitBox& box) { return March(body, box).run(); }

double smooth_union(double a_m, double b_m, double radius_m) {
  const double h = std::max(radius_m - std::abs(a_m - b_m), 0.0) / radius_m;
  return std::min(a_m, b_m) - 0.25 * h * h * radius_m;
}

double ellipsoid(const Vec3& p_m, const Vec3& centre_m, const Vec3& half_m) {
  const Vec3 scaled = (p_m - centre_m).cwiseQuotient(half_m);
  const double k0 = scaled.norm(), k1 = scaled.cwiseQuotient(half_m).norm();
  return k1 > 0 ? k0 * (k0 - 1) / k1 : -half_m.minCoeff();
}

double capsule(const Vec3& p_m, const Vec3& a_m, const Vec3& b_m, double radius_m) {
  const Vec3 along = b_m - a_m;
  const double share = std::clamp((p_m - a_m).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (p_m - a_m - share * along).norm() - radius_m;
}

}  // namespace palpate::lab
