// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/winding_number.hpp"

#include <cmath>

#include "palpate/geometry/float_lanes.hpp"

namespace palpate::geometry {
namespace {

constexpr double far_enough = 2.2;  // distance over radius from which a dipole replaces its triangles

/// Solid angle over two pi (van Oosterom and Strackee 1983), seen from the origin; positive from behind the triangle.
double solid_angle(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  const double numerator = a.dot(b.cross(c));
  const double denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
  // on the triangle itself: half a turn to either side, their mean
  if (denominator < 0 && std::abs(numerator) < 1e-12 * la * lb * lc) return 0;
  return std::atan2(numerator, denominator) / (2 * M_PI);
}

}  // namespace

WindingNumber::WindingNumber(const TriMesh& mesh) : WindingNumber(mesh, build_bvh(triangle_boxes(mesh), 8)) {}

WindingNumber::WindingNumber(const TriMesh& mesh, const Bvh& bvh)
    : nodes_(bvh.nodes.size()), corners_(bvh.order.size()), slot_(bvh.order.size()) {
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const Index t = bvh.order[i];
    slot_[t] = static_cast<Index>(i);
    for (int k = 0; k < 3; ++k) corners_[i][k] = mesh.vertices_m.row(mesh.triangles(t, k)).transpose();
  }
  std::vector<std::array<double, 2>> weight(nodes_.size(), {0, 0});
  for (auto n = static_cast<Index>(nodes_.size()) - 1; n >= 0; --n)
    for (int side = 0; side < 2; ++side) {
      const BvhNode& node = bvh.nodes[n];
      nodes_[n].child[side] = node.child[side];
      nodes_[n].count[side] = node.count[side];
      if (node.child[side] < 0) continue;
      Dipole& d = nodes_[n].dipole[side];
      double& w = weight[n][side];
      if (node.count[side] > 0) {
        for (Index i = node.child[side]; i < node.child[side] + node.count[side]; ++i) {
          const auto& [a, b, c] = corners_[i];
          const Vec3 area = 0.5 * (b - a).cross(c - a);
          const double size = area.norm();
          d.area += area;
          d.centre += size / 3 * (a + b + c);
          w += size;
        }
      } else {
        for (int s = 0; s < 2; ++s) {
          const Dipole& part = nodes_[node.child[side]].dipole[s];
          const double part_weight = weight[node.child[side]][s];
          d.area += part.area;
          d.centre += part_weight * part.centre;
          w += part_weight;
        }
      }
      d.centre = w > 0 ? Vec3(d.centre / w) : Vec3(0.5 * (node.box[side].min + node.box[side].max));
      const double radius = (node.box[side].max - d.centre).cwiseMax(d.centre - node.box[side].min).norm();
      d.near2 = far_enough * far_enough * radius * radius;
    }
}

double WindingNumber::operator()(const Vec3& p) const { return sum(p, -1); }
double WindingNumber::without(const Vec3& p, Index triangle) const { return sum(p, triangle); }

double WindingNumber::sum(const Vec3& p, Index skip) const {
  double total = 0;
  if (nodes_.empty()) return total;
  const Index skipped = skip < 0 ? -1 : slot_[skip];
  std::array<Index, bvh_stack_size> stack;
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const Node& node = nodes_[stack[--top]];
    for (int side = 0; side < 2; ++side) {
      if (node.child[side] < 0) continue;
      const Dipole& d = node.dipole[side];
      const Vec3 r = d.centre - p;
      const double r2 = r.squaredNorm();
      if (r2 > d.near2) {
        total += d.area.dot(r) / (r2 * std::sqrt(r2)) / (4 * M_PI);
      } else if (node.count[side] == 0) {
        stack[top++] = node.child[side];
        lanes::fetch(&nodes_[node.child[side]]);
      } else {
        for (Index i = node.child[side]; i < node.child[side] + node.count[side]; ++i) {
          if (i == skipped) continue;
          const auto& [a, b, c] = corners_[i];
          total += solid_angle(a - p, b - p, c - p);
        }
      }
    }
  }
  return total;
}

}  // namespace palpate::geometry
