// SPDX-License-Identifier: Apache-2.0
// Space about an object in cubes that stand on its support. Of this room alone.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::reconstruction {

struct Cubes {
  Mat3 axes = Mat3::Identity();  // columns; the last one points up
  Vec3 low = Vec3::Zero();       // corner, in those axes
  double h = 0;
  std::array<int, 3> n{};

  static constexpr std::array<std::array<int, 3>, 6> sides{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

  std::size_t count() const { return std::size_t(n[0]) * std::size_t(n[1]) * std::size_t(n[2]); }
  std::size_t at(int x, int y, int z) const { return (std::size_t(z) * std::size_t(n[1]) + std::size_t(y)) * std::size_t(n[0]) + std::size_t(x); }
  bool holds(int x, int y, int z) const { return x >= 0 && y >= 0 && z >= 0 && x < n[0] && y < n[1] && z < n[2]; }
  Vec3 middle(int x, int y, int z) const { return axes * (low + h * Vec3(x + 0.5, y + 0.5, z + 0.5)); }
  /// Of the cube that holds a point; -1 outside of all.
  std::ptrdiff_t of(const Vec3& p) const {
    const Vec3 local = (axes.transpose() * p - low) / h;
    const int x = int(std::floor(local.x())), y = int(std::floor(local.y())), z = int(std::floor(local.z()));
    return holds(x, y, z) ? std::ptrdiff_t(at(x, y, z)) : -1;
  }
  template <class Visit>
  void each(Visit visit) const {
    for (int z = 0; z < n[2]; ++z)
      for (int y = 0; y < n[1]; ++y)
        for (int x = 0; x < n[0]; ++x) visit(x, y, z);
  }
  /// Of `from`, what hangs together with `core`.
  std::vector<char> connected(const std::vector<char>& from, const std::vector<char>& core) const {
    std::vector<char> out(from.size(), 0);
    std::vector<std::array<int, 3>> pending;
    each([&](int x, int y, int z) {
      const std::size_t k = at(x, y, z);
      if (core[k] && from[k]) out[k] = 1, pending.push_back({x, y, z});
    });
    while (!pending.empty()) {
      const auto [x, y, z] = pending.back();
      pending.pop_back();
      for (const auto& s : sides) {
        const int a = x + s[0], b = y + s[1], c = z + s[2];
        if (!holds(a, b, c) || out[at(a, b, c)] || !from[at(a, b, c)]) continue;
        out[at(a, b, c)] = 1;
        pending.push_back({a, b, c});
      }
    }
    return out;
  }
};

}  // namespace palpate::reconstruction
