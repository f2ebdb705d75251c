// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/wide_bvh.hpp"

#include <cmath>

namespace palpate::geometry {
namespace {

using NodeSide = std::pair<Index, int>;

Index widen_node(const Bvh& bvh, Index node, WideBvh& out) {
  std::vector<NodeSide> children;
  for (int side = 0; side < 2; ++side)
    if (bvh.nodes[node].child[side] >= 0) children.push_back({node, side});
  const auto inner = [&](const NodeSide& s) { return bvh.nodes[s.first].count[s.second] == 0; };
  while (children.size() < 4) {  // opens the child that queries reach most often
    int widest = -1;
    double area = -1;
    for (int i = 0; i < static_cast<int>(children.size()); ++i) {
      const double a = bvh.nodes[children[i].first].box[children[i].second].half_area();
      if (inner(children[i]) && a > area) area = a, widest = i;
    }
    if (widest < 0) break;
    const Index opened = bvh.nodes[children[widest].first].child[children[widest].second];
    children[widest] = {opened, 0};
    children.push_back({opened, 1});
  }
  const auto id = static_cast<Index>(out.nodes.size());
  out.nodes.emplace_back();
  out.source.push_back({NodeSide{-1, 0}, {-1, 0}, {-1, 0}, {-1, 0}});
  for (std::size_t i = 0; i < children.size(); ++i) {
    const auto [n, side] = children[i];
    out.source[id][i] = children[i];
    out.nodes[id].count[i] = bvh.nodes[n].count[side];
    const Index child = inner(children[i]) ? widen_node(bvh, bvh.nodes[n].child[side], out) : bvh.nodes[n].child[side];
    out.nodes[id].child[i] = child;
  }
  return id;
}

/// At most v, by a few roundings of a float. Without a branch or a call: a refit asks it of every box.
float down(double v) {
  const auto f = static_cast<float>(v);
  return f - (std::abs(f) * std::numeric_limits<float>::epsilon() + std::numeric_limits<float>::min());
}

}  // namespace

WideBvh widen(const Bvh& bvh) {
  WideBvh out;
  if (bvh.nodes.empty()) return out;
  out.nodes.reserve(bvh.nodes.size() / 2 + 1);
  widen_node(bvh, 0, out);
  copy_boxes(out, bvh);
  return out;
}

void copy_boxes(WideBvh& wide, const Bvh& bvh) {
  Box all = bvh.nodes[0].box[0];
  all.add(bvh.nodes[0].box[1]);
  wide.centre = 0.5 * (all.min + all.max);
  wide.extent = 0.5 * (all.max - all.min).maxCoeff();
  const float far = std::numeric_limits<float>::infinity();
  for (std::size_t n = 0; n < wide.nodes.size(); ++n)
    for (int i = 0; i < 4; ++i) {
      const auto [node, side] = wide.source[n][i];
      for (int k = 0; k < 3; ++k) {
        wide.nodes[n].min[k][i] = node < 0 ? far : down(bvh.nodes[node].box[side].min[k] - wide.centre[k]);
        wide.nodes[n].max[k][i] = node < 0 ? -far : -down(wide.centre[k] - bvh.nodes[node].box[side].max[k]);
      }
    }
}

}  // namespace palpate::geometry
