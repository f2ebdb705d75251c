// SPDX-License-Identifier: Apache-2.0
// Inside of TriangleTree, WindingNumber and the embedding: a binary hierarchy over the boxes of triangles or tetrahedra.
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

/// Axis-aligned box; empty until something is added.
struct Box {
  Vec3 min = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 max = Vec3::Constant(-std::numeric_limits<double>::infinity());
  double squared_distance(const Vec3& p) const { return (min - p).cwiseMax(p - max).cwiseMax(0.0).squaredNorm(); }
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

inline constexpr int bvh_stack_size = 128;

/// A node holds the boxes of its two children, so that a query decides which one to visit without touching either.
/// count > 0: leaf, items order[child .. child + count). count == 0: inner node `child`. child < 0: nothing there.
struct BvhNode {
  std::array<Box, 2> box;
  std::array<Index, 2> child{-1, -1};
  std::array<Index, 2> count{0, 0};
};

struct Bvh {
  std::vector<BvhNode> nodes;  ///< root first, children behind their parent
  std::vector<Index> order;    ///< item ids, leaf after leaf
  int depth = 0;               ///< longest path; at most 40 + 32, so that a stack of bvh_stack_size holds any query
};

/// Binned surface-area heuristic (Wald 2007), single-threaded and deterministic.
Bvh build_bvh(const std::vector<Box>& boxes, int max_leaf_size);

std::vector<Box> triangle_boxes(const TriMesh& mesh);

/// Recomputes the boxes for moved vertices; the topology stays.
void refit_bvh(Bvh& bvh, const Points& vertices_m, const Triangles& triangles);

}  // namespace palpate::geometry
