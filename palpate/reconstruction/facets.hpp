// SPDX-License-Identifier: Apache-2.0
// Small oriented pieces of a surface, laid through points. Of this room alone.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::reconstruction {

using Key = std::uint64_t;
using Cell = std::array<std::int64_t, 3>;

inline Key key_of(const Cell& c) {
  constexpr std::int64_t offset = 1 << 20;
  return (Key(c[0] + offset) << 42) | (Key(c[1] + offset) << 21) | Key(c[2] + offset);
}

struct Facet {
  Vec3 middle, normal;
  double area_m2 = 0, sigma_m = 0;
};

inline std::pair<Vec3, Vec3> tangents(const Vec3& n) {
  const Vec3 u = n.unitOrthogonal();
  return {u, n.cross(u)};
}

/// Points with normals in cubic cells.
class Grid {
 public:
  Grid(const std::vector<PointCloud>& clouds, double cell) : cell_(cell) {
    for (const PointCloud& c : clouds)
      for (Index i = 0; i < c.points_m.rows(); ++i) {
        const Vec3 p = c.points_m.row(i).transpose(), n = c.normals.row(i).transpose();
        if (!p.allFinite() || !n.allFinite()) continue;
        const auto [it, fresh] = index_.try_emplace(key_of(cell_of(p)), static_cast<Index>(bins_.size()));
        if (fresh) bins_.emplace_back();
        bins_[it->second].push_back(static_cast<Index>(points_.size()));
        points_.push_back(p);
        normals_.push_back(n);
      }
  }

  const std::vector<std::vector<Index>>& bins() const { return bins_; }
  const Vec3& point(Index i) const { return points_[i]; }
  const Vec3& normal(Index i) const { return normals_[i]; }

  /// Is any point like that in the place's cell or those around it?
  template <class F>
  bool any_around(const Vec3& p, F like) const {
    const Cell c = cell_of(p);
    constexpr std::array<std::int64_t, 3> own_first{0, -1, 1};
    for (const auto x : own_first)
      for (const auto y : own_first)
        for (const auto z : own_first)
          if (const auto it = index_.find(key_of({c[0] + x, c[1] + y, c[2] + z})); it != index_.end())
            for (const Index i : bins_[it->second])
              if (like(i)) return true;
    return false;
  }

  template <class F>
  void around(const Vec3& p, int reach, F visit) const {
    const Cell c = cell_of(p);
    for (std::int64_t x = -reach; x <= reach; ++x)
      for (std::int64_t y = -reach; y <= reach; ++y)
        for (std::int64_t z = -reach; z <= reach; ++z)
          if (const auto it = index_.find(key_of({c[0] + x, c[1] + y, c[2] + z})); it != index_.end())
            for (const Index i : bins_[it->second]) visit(i);
  }

 private:
  Cell cell_of(const Vec3& p) const {
    return {std::int64_t(std::floor(p.x() / cell_)), std::int64_t(std::floor(p.y() / cell_)),
            std::int64_t(std::floor(p.z() / cell_))};
  }
  double cell_;
  std::vector<Vec3> points_, normals_;
  std::vector<std::vector<Index>> bins_;
  std::unordered_map<Key, Index> index_;
};

/// Puts the facet on the quadratic surface through the points around it (moving least squares, Levin 1998).
/// @returns false where there are too few
bool settle(Facet& facet, const Grid& grid, double cell);

/// Area that each facet stands for: that of a disc over the number of facets in it.
void share_out_area(std::vector<Facet>& facets, double cell);

/// One equilateral triangle a facet, as large as it.
TriMesh triangles_of(const std::vector<Facet>& facets);

/// Of such a triangle.
Vec3 middle_of(const TriMesh& facets, Index triangle);
Vec3 area_of(const TriMesh& facets, Index triangle);

}  // namespace palpate::reconstruction
