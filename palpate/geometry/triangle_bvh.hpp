// SPDX-License-Identifier: Apache-2.0
// Inside of TriangleTree and WindingNumber: a binary hierarchy of boxes over triangles.
#pragma once

#include <array>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

/// Axis-aligned box; empty until something is added.
struct Box {
  Vec3 min = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 max = Vec3::Constant(-std::numeric_limits<double>::infinity());
  void add(const Vec3& p) {
    min = min.cwiseMin(p);
    max = max.cwiseMax(p);
  }
  void add(const Box& b) {
    min = min.cwiseMin(b.min);
    max = max.cwiseMax(b.max);
  }
  double half_area() const {
    const Vec3 e = (max - min).cwiseMax(0.0);
    return e.x() * e.y() + e.y() * e.z() + e.z() * e.x();
  }
};

/// A node holds the boxes of its two children, so that a query decides which one to visit without touching either.
/// count > 0: leaf, triangles order[child .. child + count). count == 0: inner node `child`. child < 0: nothing there.
struct BvhNode {
  std::array<Box, 2> box;
  std::array<Index, 2> child{-1, -1};
  std::array<Index, 2> count{0, 0};
};

struct TriangleBvh {
  std::vector<BvhNode> nodes;  ///< root first, children behind their parent
  std::vector<Index> order;    ///< triangle ids, leaf after leaf
  int depth = 0;               ///< longest path; queries need a stack of depth + 1
};

/// Binned surface-area heuristic (Wald 2007), single-threaded and deterministic.
TriangleBvh build_bvh(const TriMesh& mesh, int max_leaf_size);

/// Recomputes the boxes for moved vertices; the topology stays.
void refit_bvh(TriangleBvh& bvh, const Points& vertices_m, const Triangles& triangles);

}  // namespace palpate::geometry
