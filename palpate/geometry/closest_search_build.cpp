// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <cmath>

#include "palpate/geometry/closest_search.hpp"

namespace palpate::geometry {
namespace {

using Source = Index;  // a child of the binary hierarchy: 2 node + side
using Children = std::vector<Source>;

int within_byte(double v) { return static_cast<int>(std::clamp(v, 0.0, 255.0)); }

const Box& box_of(const Bvh& bvh, Source s) { return bvh.nodes[s / 2].box[s % 2]; }
Index child_of(const Bvh& bvh, Source s) { return bvh.nodes[s / 2].child[s % 2]; }
Index leaf_count(const Bvh& bvh, Source s) { return bvh.nodes[s / 2].count[s % 2]; }

}  // namespace

/// Which subtrees become the eight children of a node: those that make the sum of all nodes' and blocks' surfaces smallest.
/// Found from the leaves up (Ylitie, Karras, Laine 2017, section 3.1).
class Packing {
 public:
  Packing(const Bvh& bvh, int width, int block_size) : bvh_(bvh), width_(width), block_size_(block_size) {
    count_.resize(2 * bvh.nodes.size());
    plans_.resize(2 * bvh.nodes.size());
    for (Index s = static_cast<Index>(count_.size()) - 1; s >= 0; --s) {
      const Index child = child_of(bvh, s);
      if (child < 0) continue;
      count_[s] = leaf_count(bvh, s) > 0 ? leaf_count(bvh, s) : count_[2 * child] + count_[2 * child + 1];
      plan(s);
    }
  }
  bool is_block(Source s) const { return count_[s] <= block_size_; }
  Index count(Source s) const { return count_[s]; }
  Index first(Source s) const {
    while (leaf_count(bvh_, s) == 0) s = 2 * child_of(bvh_, s);
    return child_of(bvh_, s);
  }
  /// Children of the node that stands for binary node `node`.
  Children children(Index node) const {
    Children out;
    const Source left = 2 * node, right = left + 1;
    if (count_[left] == 0) return {right};  // a surface of one leaf
    if (count_[right] == 0) return {left};
    const int share = best_split(node, width_).second;
    gather(left, share, out);
    gather(right, width_ - share, out);
    return out;
  }

 private:
  struct Plan {
    std::array<float, 8> cost{};         // with at most 1 .. 7 roots
    std::array<std::int8_t, 8> split{};  // roots that the left child gets; 0: as with one root fewer
  };

  std::pair<float, int> best_split(Index node, int roots) const {
    std::pair<float, int> best{std::numeric_limits<float>::infinity(), 1};
    for (int left = std::max(1, roots - width_ + 1); left < std::min(roots, width_); ++left) {
      const float cost = plans_[2 * node].cost[left] + plans_[2 * node + 1].cost[roots - left];
      if (cost < best.first) best = {cost, left};
    }
    return best;
  }
  void plan(Source s) {
    Plan& p = plans_[s];
    const auto area = static_cast<float>(box_of(bvh_, s).half_area());
    if (is_block(s)) {
      p.cost.fill(area);
      return;
    }
    const Index child = child_of(bvh_, s);
    p.cost[1] = area + best_split(child, width_).first;
    for (int roots = 2; roots < width_; ++roots) {
      const auto [cost, left] = best_split(child, roots);
      const bool better = cost < p.cost[roots - 1];
      p.cost[roots] = better ? cost : p.cost[roots - 1];
      p.split[roots] = static_cast<std::int8_t>(better ? left : 0);
    }
  }
  void gather(Source s, int roots, Children& out) const {
    while (roots > 1 && plans_[s].split[roots] == 0) --roots;
    if (roots == 1) {
      out.push_back(s);
      return;
    }
    const int left = plans_[s].split[roots];
    gather(2 * child_of(bvh_, s), left, out);
    gather(2 * child_of(bvh_, s) + 1, roots - left, out);
  }

  const Bvh& bvh_;
  int width_, block_size_;
  std::vector<Index> count_;
  std::vector<Plan> plans_;
};

struct ClosestSearch::Builder {
  ClosestSearch& out;
  const Bvh& bvh;
  Packing packing{bvh, width, block_size};

  Index node(Index binary) {
    const Children children = packing.children(binary);
    const auto id = static_cast<Index>(out.nodes_.size());
    out.nodes_.emplace_back();
    out.source_.push_back({});
    out.nodes_[id].valid = (1U << children.size()) - 1;
    for (std::size_t i = 0; i < children.size(); ++i) {
      out.source_[id][i] = children[i];
      const Index child = packing.is_block(children[i]) ? ~(block(children[i]) << 6 | (packing.count(children[i]) - 1))
                                                        : node(child_of(bvh, children[i]));
      out.nodes_[id].child[i] = child;
    }
    return id;
  }
  Index block(Source s) {
    const auto id = static_cast<Index>(out.triangle_.size()) / block_size;
    const Index first = packing.first(s);
    for (Index i = 0; i < block_size; ++i) out.triangle_.push_back(i < packing.count(s) ? bvh.order[first + i] : -1);
    return id;
  }
};

ClosestSearch::ClosestSearch(const TriMesh& mesh, const Bvh& bvh) {
  Builder{*this, bvh}.node(0);
  slot_.resize(mesh.triangles.rows());
  for (std::size_t i = 0; i < triangle_.size(); ++i)
    if (triangle_[i] >= 0) slot_[triangle_[i]] = static_cast<Index>(i);
  exact_.resize(triangle_.size());
  blocks_.resize(triangle_.size() / block_size);
  place(mesh, bvh);
}

void ClosestSearch::refit(const TriMesh& mesh, const Bvh& bvh) { place(mesh, bvh); }

void ClosestSearch::place(const TriMesh& mesh, const Bvh& bvh) {
  Box all = bvh.nodes[0].box[0];
  all.add(bvh.nodes[0].box[1]);
  centre_m_ = 0.5 * (all.min + all.max);
  low_m_ = all.min;
  extent_m_ = std::max(0.5 * (all.max - all.min).maxCoeff(), 1e-20);
  unit_m_ = 2 * extent_m_ / 65535;
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    Node& node = nodes_[n];
    const int children = std::popcount(node.valid);
    Box around;
    for (int i = 0; i < children; ++i) around.add(box_of(bvh, source_[n][i]));
    for (int k = 0; k < 3; ++k) {
      const double low = around.min[k] - centre_m_[k];
      node.origin[k] = static_cast<float>(low);
      if (node.origin[k] > low) node.origin[k] = std::nextafter(node.origin[k], -std::numeric_limits<float>::infinity());
      const double start = centre_m_[k] + node.origin[k];
      int exponent = 0;  // the power of two above a 255th; flat nodes get steps that floats can divide by
      std::frexp(std::max(around.max[k] - start, 1e-6 * extent_m_) / 254, &exponent);
      node.step[k] = std::ldexp(1.0F, exponent);
      const double per_step = 1 / double(node.step[k]);
      for (int i = 0; i < children; ++i) {
        const Box& box = box_of(bvh, source_[n][i]);
        const double low_steps = (box.min[k] - start) * per_step, high_steps = (box.max[k] - start) * per_step;
        node.low[k][i] = static_cast<std::uint8_t>(within_byte(low_steps));
        const int high_byte = within_byte(high_steps);
        node.high[k][i] = static_cast<std::uint8_t>(std::min(255, high_byte + (high_byte < high_steps ? 1 : 0)));
      }
    }
    for (int i = 0; i < children; ++i)
      if (node.child[i] < 0) {
        const Index reference = ~node.child[i];
        node.child[i] = ~static_cast<Index>((reference & ~60) | fill(reference >> 6, (reference & 3) + 1, mesh) << 2);
      }
  }
}

/// @returns bit a triangle for which the bounds of the search are not to be trusted
std::uint32_t ClosestSearch::fill(Index block, int count, const TriMesh& mesh) {
  std::uint32_t thin = 0;
  const double per_unit = 1 / unit_m_;
  auto& corner = blocks_[block].corner;
  for (int i = 0; i < block_size; ++i) {
    if (i >= count) {
      for (auto& axes : corner)
        for (auto& values : axes) values[i] = values[i - 1];
      continue;
    }
    const Index slot = block_size * block + i, triangle = triangle_[slot];
    Corner& t = exact_[slot];
    t = make_corner(mesh.vertices_m, mesh.triangles, triangle);
    std::array<Vec3, 3> at;
    for (int c = 0; c < 3; ++c) {
      const Vec3 exact = (mesh.vertices_m.row(mesh.triangles(triangle, c)).transpose() - low_m_) * per_unit;
      for (int k = 0; k < 3; ++k) {
        const int rounded = static_cast<int>(exact[k] + 0.5);  // 0 to 65535: the grid is laid around all vertices
        corner[c][k][i] = static_cast<std::uint16_t>(rounded);
        at[c][k] = rounded;
      }
    }
    // Floats cannot tell the normal of a long needle. Up to 2048 units their products are exact.
    const Vec3 ab = at[1] - at[0], ac = at[2] - at[0];
    const double longest2 = std::max({ab.squaredNorm(), ac.squaredNorm(), (ac - ab).squaredNorm()});
    if (longest2 > 2048.0 * 2048 && ab.cross(ac).squaredNorm() < 1.5e-5 * longest2 * longest2) thin |= 1U << i;
  }
  return thin;
}

}  // namespace palpate::geometry
