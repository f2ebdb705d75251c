// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/vertex_tree.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate::geometry {
namespace {

constexpr Index leaf_size = 8;

void check(const Points& vertices_m) {
  if (vertices_m.rows() == 0) throw Error("there is no point; give at least one", "VertexTree: vertices_m");
  if (!vertices_m.allFinite()) throw Error("a point is not finite; remove it or repair the mesh", "VertexTree: vertices_m");
}

double squared_to_box(const std::array<double, 3>& min_m, const std::array<double, 3>& max_m, const Vec3& p) {
  double sum = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double x = p(static_cast<Eigen::Index>(k)), out = std::max({min_m[k] - x, x - max_m[k], 0.0});
    sum += out * out;
  }
  return sum;
}

}  // namespace

VertexTree::VertexTree(const Points& vertices_m) {
  check(vertices_m);
  const auto count = static_cast<std::size_t>(vertices_m.rows());
  vertex_at_.resize(count);
  std::iota(vertex_at_.begin(), vertex_at_.end(), Index{0});
  for (auto& axis : at_m_) axis.resize(count);
  split(vertices_m, 0, static_cast<Index>(count));
  place_of_.resize(count);
  for (std::size_t i = 0; i < count; ++i) place_of_[static_cast<std::size_t>(vertex_at_[i])] = static_cast<Index>(i);
  refit(vertices_m);
}

// Halves of equal number along the longest side.
Index VertexTree::split(const Points& vertices_m, Index begin, Index end) {
  const auto self = static_cast<Index>(nodes_.size());
  nodes_.push_back({{}, {}, begin, end, 0});
  if (end - begin <= leaf_size) return self;
  Eigen::RowVector3d low = vertices_m.row(vertex_at_[static_cast<std::size_t>(begin)]), high = low;
  for (Index i = begin; i < end; ++i) {
    low = low.cwiseMin(vertices_m.row(vertex_at_[static_cast<std::size_t>(i)]));
    high = high.cwiseMax(vertices_m.row(vertex_at_[static_cast<std::size_t>(i)]));
  }
  Eigen::Index axis = 0;
  (high - low).maxCoeff(&axis);
  const Index middle = begin + (end - begin) / 2;
  const auto at = [&](Index i) { return vertex_at_.begin() + i; };
  std::nth_element(at(begin), at(middle), at(end), [&](Index a, Index b) { return vertices_m(a, axis) < vertices_m(b, axis); });
  split(vertices_m, begin, middle);
  const Index right = split(vertices_m, middle, end);
  nodes_[static_cast<std::size_t>(self)].right = right;
  return self;
}

void VertexTree::refit(const Points& vertices_m) {
  check(vertices_m);
  if (static_cast<std::size_t>(vertices_m.rows()) != vertex_at_.size())
    throw Error("has " + std::to_string(vertices_m.rows()) + " rows, the tree was built for " + std::to_string(vertex_at_.size()),
                "VertexTree::refit: vertices_m");
  for (std::size_t i = 0; i < vertex_at_.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) at_m_[k][i] = vertices_m(vertex_at_[i], static_cast<Eigen::Index>(k));
  for (std::size_t n = nodes_.size(); n-- > 0;) {  // children stand behind their parents
    Node& node = nodes_[n];
    for (std::size_t k = 0; k < 3; ++k) {
      if (node.right > 0) {
        const Node &left = nodes_[n + 1], &right = nodes_[static_cast<std::size_t>(node.right)];
        node.min_m[k] = std::min(left.min_m[k], right.min_m[k]);
        node.max_m[k] = std::max(left.max_m[k], right.max_m[k]);
      } else {
        const auto [low, high] = std::minmax_element(at_m_[k].begin() + node.begin, at_m_[k].begin() + node.end);
        node.min_m[k] = *low;
        node.max_m[k] = *high;
      }
    }
  }
}

double VertexTree::squared_to(Index place, const Vec3& p) const {
  const auto i = static_cast<std::size_t>(place);
  const double x = at_m_[0][i] - p.x(), y = at_m_[1][i] - p.y(), z = at_m_[2][i] - p.z();
  return x * x + y * y + z * z;
}

NearestVertex VertexTree::nearest(const Vec3& p, Index hint) const {
  if (!p.allFinite()) return {-1, std::numeric_limits<double>::quiet_NaN()};
  NearestVertex best{-1, std::numeric_limits<double>::infinity()};
  if (hint >= 0 && hint < static_cast<Index>(place_of_.size()))
    best = {hint, squared_to(place_of_[static_cast<std::size_t>(hint)], p)};
  struct Visit {
    Index node;
    double squared;
  };
  constexpr double rounding = 1 + 1e-14;  // a box is never nearer than what is in it, but for the last digit
  std::array<Visit, 128> stack;  // halves: two a level
  std::size_t top = 0;
  stack[top++] = {0, 0};
  while (top > 0) {
    const Visit visit = stack[--top];
    if (visit.squared > best.squared_distance_m2 * rounding) continue;
    const Node& node = nodes_[static_cast<std::size_t>(visit.node)];
    if (node.right == 0) {
      for (Index i = node.begin; i < node.end; ++i) {
        const double squared = squared_to(i, p);
        const Index vertex = vertex_at_[static_cast<std::size_t>(i)];
        if (squared < best.squared_distance_m2 || (squared == best.squared_distance_m2 && vertex < best.vertex)) best = {vertex, squared};
      }
      continue;
    }
    const auto to = [&](Index child) {
      const Node& box = nodes_[static_cast<std::size_t>(child)];
      return Visit{child, squared_to_box(box.min_m, box.max_m, p)};
    };
    const Visit left = to(visit.node + 1), right = to(node.right);
    const bool left_first = left.squared <= right.squared;
    stack[top++] = left_first ? right : left;
    stack[top++] = left_first ? left : right;
  }
  return best;
}

}  // namespace palpate::geometry
