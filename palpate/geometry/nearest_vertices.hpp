// SPDX-License-Identifier: Apache-2.0
// The nearest of many vertices that move a little between questions, for points that move a little too (ICP on a surface that
// is simulated again and again).
#pragma once

#include <memory>

#include "palpate/core/math.hpp"

namespace palpate::geometry {

/// A k-d tree (nanoflann) of where the vertices were once. A point that was answered remembers how far every other vertex was at
/// least; until point and vertices have moved by what that leaves, its answer is the same and nothing is searched. Where the
/// margin is used up, all vertices that may have come nearer are asked where they are now: answers are exact throughout.
class NearestVertices {
 public:
  /// @param vertices_m  n x 3
  /// @throws Error when there is none, or one is not finite
  explicit NearestVertices(Points vertices_m);
  ~NearestVertices();
  NearestVertices(NearestVertices&&) noexcept;
  NearestVertices& operator=(NearestVertices&&) noexcept;

  /// The same vertices elsewhere.
  /// @throws Error when the number of rows differs or a vertex is not finite; they are then as before
  void move(const Points& vertices_m);

  /// What one point remembers of its last answer; a new one knows nothing.
  struct Memory {
    Index vertex = -1;
    Vec3 asked_m = Vec3::Zero();
    double others_m = 0;  ///< from there, every other vertex of the tree is at least as far
    int tree = -1;        ///< which tree that was; -1: none
  };
  struct Found {
    Index vertex = -1;  ///< of those that are equally near the one that was nearest before, else the one with the smallest number
    double squared_distance_m2 = 0;
  };
  /// A point that is not finite gets vertex -1 and a squared distance of NaN.
  Found nearest(const Vec3& point_m, Memory& memory) const;

  const Points& vertices_m() const;  ///< where they are now

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::geometry
