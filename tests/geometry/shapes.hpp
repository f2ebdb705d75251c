// SPDX-License-Identifier: Apache-2.0
// Closed surfaces whose volume and shape are known, for tests of geometry.
#pragma once

#include <cmath>
#include <map>
#include <random>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::shapes {

inline TriMesh make(const std::vector<Vec3>& v, const std::vector<std::array<Index, 3>>& t) {
  TriMesh m;
  m.vertices_m.resize(static_cast<Eigen::Index>(v.size()), 3);
  m.triangles.resize(static_cast<Eigen::Index>(t.size()), 3);
  for (std::size_t i = 0; i < v.size(); ++i) m.vertices_m.row(i) = v[i].transpose();
  for (std::size_t i = 0; i < t.size(); ++i) m.triangles.row(i) << t[i][0], t[i][1], t[i][2];
  return m;
}

inline TriMesh box(const Vec3& size, const Vec3& origin = Vec3::Zero()) {
  std::vector<Vec3> v;
  for (int i = 0; i < 8; ++i) v.push_back(origin + Vec3((i & 1) * size.x(), ((i >> 1) & 1) * size.y(), (i >> 2) * size.z()));
  return make(v, {{0, 2, 1},
                  {1, 2, 3},
                  {4, 5, 6},
                  {5, 7, 6},
                  {0, 1, 4},
                  {1, 5, 4},
                  {2, 6, 3},
                  {3, 6, 7},
                  {0, 4, 2},
                  {2, 4, 6},
                  {1, 3, 5},
                  {3, 7, 5}});
}

/// Icosahedron, `levels` times refined, corners on the sphere.
inline TriMesh sphere(double radius, int levels, const Vec3& centre = Vec3::Zero()) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  std::vector<Vec3> v{{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                      {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  for (Vec3& p : v) p.normalize();
  std::vector<std::array<Index, 3>> t{{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                                      {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                                      {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (int l = 0; l < levels; ++l) {
    std::map<std::pair<Index, Index>, Index> middle;
    const auto mid = [&](Index a, Index b) {
      const auto key = std::minmax(a, b);
      const auto [it, fresh] = middle.try_emplace({key.first, key.second}, static_cast<Index>(v.size()));
      if (fresh) v.push_back((v[a] + v[b]).normalized());
      return it->second;
    };
    std::vector<std::array<Index, 3>> next;
    for (const auto& [a, b, c] : t) {
      const Index ab = mid(a, b), bc = mid(b, c), ca = mid(c, a);
      next.insert(next.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    t = next;
  }
  for (Vec3& p : v) p = centre + radius * p;
  return make(v, t);
}

/// Torus around z.
inline TriMesh torus(double ring_radius, double tube_radius, int around, int across) {
  std::vector<Vec3> v;
  std::vector<std::array<Index, 3>> t;
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      const double a = 2 * M_PI * i / around, b = 2 * M_PI * j / across;
      const double r = ring_radius + tube_radius * std::cos(b);
      v.emplace_back(r * std::cos(a), r * std::sin(a), tube_radius * std::sin(b));
      const auto id = [&](int p, int q) { return static_cast<Index>((p % around) * across + q % across); };
      t.push_back({id(i, j), id(i + 1, j), id(i + 1, j + 1)});
      t.push_back({id(i, j), id(i + 1, j + 1), id(i, j + 1)});
    }
  return make(v, t);
}

inline TriMesh join(const TriMesh& a, const TriMesh& b) {
  TriMesh m;
  m.vertices_m.resize(a.vertices_m.rows() + b.vertices_m.rows(), 3);
  m.vertices_m << a.vertices_m, b.vertices_m;
  m.triangles.resize(a.triangles.rows() + b.triangles.rows(), 3);
  m.triangles << a.triangles, (b.triangles.array() + static_cast<Index>(a.vertices_m.rows())).matrix();
  return m;
}

/// Triangles without any order, among them points, lines, needles and copies.
inline TriMesh soup(int count, std::uint32_t seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<Vec3> v;
  std::vector<std::array<Index, 3>> t;
  const auto point = [&] { return Vec3(u(rng), u(rng), u(rng)); };
  for (int i = 0; i < count; ++i) {
    const Vec3 a = point(), d = 0.3 * point(), e = 0.3 * point();
    const auto n = static_cast<Index>(v.size());
    v.insert(v.end(), {a, a + d, a + e});
    switch (i % 8) {
      case 1:
        v[n + 1] = v[n + 2] = a;
        break;  // a point
      case 2:
        v[n + 2] = a + 0.37 * d;
        break;  // a line, third corner within
      case 3:
        v[n + 2] = a + 1.7 * d + 1e-9 * e;
        break;  // a needle
      case 4:
        v[n + 1] = a + 1e-4 * d;
        break;  // a short edge
      case 5:
        v[n + 1].x() = v[n + 2].x() = a.x();
        break;  // a flat box
      default:
        break;
    }
    t.push_back({n, n + 1, n + 2});
    if (i % 16 == 7) t.push_back({n, n + 2, n + 1});
  }
  return make(v, t);
}

}  // namespace palpate::shapes
