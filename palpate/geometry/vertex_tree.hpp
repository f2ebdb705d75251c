// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

struct NearestVertex {
  Index vertex = -1;
  double squared_distance_m2 = 0;
};

/// k-d tree over points that move little: split where they were first, its boxes following them. Exact in double.
/// Const queries are thread-safe.
class VertexTree {
 public:
  /// @throws Error when there is no point, or one is not finite.
  explicit VertexTree(const Points& vertices_m);

  /// The same points, moved.
  /// @throws Error when the number of rows differs or one is not finite; the tree is then as before.
  void refit(const Points& vertices_m);

  /// Of points that are equally near the one with the smallest number. `hint`: one that is likely near (the last answer), or
  /// -1; it changes nothing but the speed. A point that is not finite gets -1 and NaN.
  NearestVertex nearest(const Vec3& point_m, Index hint = -1) const;

 private:
  struct Node {
    std::array<double, 3> min_m{}, max_m{};
    Index begin = 0, end = 0;  ///< places
    Index right = 0;           ///< the left child follows its parent; 0: a leaf
  };
  Index split(const Points& vertices_m, Index begin, Index end);
  double squared_to(Index place, const Vec3& p) const;

  std::vector<Node> nodes_;
  std::vector<Index> vertex_at_, place_of_;
  std::array<std::vector<double>, 3> at_m_;  ///< by place, so that a leaf's lie side by side
};

}  // namespace palpate::geometry
