// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/bvh.hpp"

#include <algorithm>
#include <numeric>

namespace palpate::geometry {
namespace {

constexpr int bins = 16;
constexpr int deepest_sah = 40;  // below this depth ranges are halved, so that no input makes a path longer than 40 + 32

Box triangle_box(const Points& v, const Triangles& t, Index i) {
  Box b;
  for (int k = 0; k < 3; ++k) b.add(v.row(t(i, k)).transpose());
  return b;
}

struct Builder {
  const std::vector<Box>& boxes;
  int max_leaf_size;
  Bvh out;
  std::vector<Vec3> centres;

  Box range_box(Index first, Index last) const {
    Box b;
    for (Index i = first; i < last; ++i) b.add(boxes[out.order[i]]);
    return b;
  }

  /// Where to cut order[first, last); it is reordered so that the left part comes first. `first` when a leaf is cheaper.
  Index split(Index first, Index last, int depth) {
    const Index n = last - first;
    Box spread;
    for (Index i = first; i < last; ++i) spread.add(centres[out.order[i]]);
    const Vec3 extent = spread.max - spread.min;
    int best_axis = -1, best_bin = 0;
    double best_cost = std::numeric_limits<double>::infinity();
    if (depth < deepest_sah) {
      std::array<std::array<Box, bins>, 3> box;
      std::array<std::array<Index, bins>, 3> count{};
      Vec3 scale;
      for (int axis = 0; axis < 3; ++axis) scale[axis] = extent[axis] > 0 ? bins / extent[axis] : 0;
      for (Index i = first; i < last; ++i) {  // all axes at once: items lie scattered over the memory
        const Index id = out.order[i];
        const Box& item = boxes[id];
        for (int axis = 0; axis < 3; ++axis) {
          const int b = std::min(bins - 1, static_cast<int>((centres[id][axis] - spread.min[axis]) * scale[axis]));
          box[axis][b].add(item);
          ++count[axis][b];
        }
      }
      for (int axis = 0; axis < 3; ++axis) {
        if (!(extent[axis] > 0)) continue;
        std::array<double, bins> right{};
        Box sum;
        Index c = 0;
        for (int b = bins - 1; b > 0; --b) {
          sum.add(box[axis][b]);
          c += count[axis][b];
          right[b] = c > 0 ? sum.half_area() * c : 0;
        }
        sum = Box();
        c = 0;
        for (int b = 0; b + 1 < bins; ++b) {
          sum.add(box[axis][b]);
          c += count[axis][b];
          if (c == 0 || c == n) continue;
          const double cost = sum.half_area() * c + right[b + 1];
          if (cost < best_cost) best_cost = cost, best_axis = axis, best_bin = b;
        }
      }
    }
    const auto begin = out.order.begin() + first, end = out.order.begin() + last;
    if (best_axis >= 0) {
      const double area = range_box(first, last).half_area();
      const double box_test = 0.5;  // cost of a pair of boxes against one triangle
      if (n <= max_leaf_size && best_cost + box_test * area >= area * n) return first;
      const double scale = bins / extent[best_axis];
      const auto middle = std::partition(begin, end, [&](Index id) {
        return std::min(bins - 1, static_cast<int>((centres[id][best_axis] - spread.min[best_axis]) * scale)) <= best_bin;
      });
      return static_cast<Index>(middle - out.order.begin());
    }
    if (n <= max_leaf_size) return first;
    int axis = 0;
    extent.maxCoeff(&axis);
    const auto middle = begin + n / 2;
    std::nth_element(begin, middle, end, [&](Index a, Index b) {
      return centres[a][axis] != centres[b][axis] ? centres[a][axis] < centres[b][axis] : a < b;
    });
    return static_cast<Index>(middle - out.order.begin());
  }

  /// Makes the node of a range that was cut at `middle`.
  Index node(Index first, Index middle, Index last, int depth) {
    out.depth = std::max(out.depth, depth);
    const auto id = static_cast<Index>(out.nodes.size());
    out.nodes.emplace_back();
    const std::array<std::pair<Index, Index>, 2> parts{std::pair{first, middle}, std::pair{middle, last}};
    for (int side = 0; side < 2; ++side) {
      const auto [a, b] = parts[side];
      if (a == b) continue;
      out.nodes[id].box[side] = range_box(a, b);
      const Index cut = b - a > 1 ? split(a, b, depth) : a;
      if (cut == a || cut == b) {
        out.nodes[id].child[side] = a;
        out.nodes[id].count[side] = b - a;
      } else {
        const Index inner = node(a, cut, b, depth + 1);
        out.nodes[id].child[side] = inner;
      }
    }
    return id;
  }
};

}  // namespace

Bvh build_bvh(const std::vector<Box>& boxes, int max_leaf_size) {
  Builder b{boxes, max_leaf_size, {}, {}};
  const auto n = static_cast<Index>(boxes.size());
  b.out.order.resize(n);
  std::iota(b.out.order.begin(), b.out.order.end(), 0);
  b.centres.reserve(n);
  for (const Box& box : boxes) b.centres.push_back(0.5 * (box.min + box.max));
  b.out.nodes.reserve(n);
  if (n > 0) b.node(0, n > 1 ? b.split(0, n, 0) : 0, n, 1);
  return std::move(b.out);
}

std::vector<Box> triangle_boxes(const TriMesh& mesh) {
  std::vector<Box> boxes;
  boxes.reserve(mesh.triangles.rows());
  for (Index i = 0; i < mesh.triangles.rows(); ++i) boxes.push_back(triangle_box(mesh.vertices_m, mesh.triangles, i));
  return boxes;
}

void refit_bvh(Bvh& bvh, const Points& vertices_m, const Triangles& triangles) {
  for (auto node = bvh.nodes.rbegin(); node != bvh.nodes.rend(); ++node) {
    for (int side = 0; side < 2; ++side) {
      if (node->child[side] < 0) continue;
      Box b;
      if (node->count[side] == 0) {
        const BvhNode& inner = bvh.nodes[node->child[side]];
        b.add(inner.box[0]);
        b.add(inner.box[1]);
      } else {
        for (Index i = 0; i < node->count[side]; ++i)
          b.add(triangle_box(vertices_m, triangles, bvh.order[node->child[side] + i]));
      }
      node->box[side] = b;
    }
  }
}

}  // namespace palpate::geometry
