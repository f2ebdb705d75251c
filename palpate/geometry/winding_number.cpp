// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/winding_number.hpp"

#include <array>
#include <cmath>
#include <utility>

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

WindingNumber::WindingNumber(const TriMesh& mesh, Bvh bvh)
    : vertices_(mesh.vertices_m), triangles_(mesh.triangles), bvh_(std::move(bvh)) {
  dipoles_.resize(2 * bvh_.nodes.size());
  std::vector<double> weight(dipoles_.size(), 0);
  const auto corner = [&](Index t, int k) { return Vec3(vertices_.row(triangles_(t, k)).transpose()); };
  for (auto n = static_cast<Index>(bvh_.nodes.size()) - 1; n >= 0; --n)
    for (int side = 0; side < 2; ++side) {
      const BvhNode& node = bvh_.nodes[n];
      if (node.child[side] < 0) continue;
      Dipole& d = dipoles_[2 * n + side];
      double& w = weight[2 * n + side];
      if (node.count[side] > 0) {
        for (Index i = node.child[side]; i < node.child[side] + node.count[side]; ++i) {
          const Index t = bvh_.order[i];
          const Vec3 area = 0.5 * (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
          const double size = area.norm();
          d.area += area;
          d.centre += size / 3 * (corner(t, 0) + corner(t, 1) + corner(t, 2));
          w += size;
        }
      } else {
        for (int s = 0; s < 2; ++s) {
          const auto child = 2 * node.child[side] + s;
          d.area += dipoles_[child].area;
          d.centre += weight[child] * dipoles_[child].centre;
          w += weight[child];
        }
      }
      d.centre = w > 0 ? Vec3(d.centre / w) : Vec3(0.5 * (node.box[side].min + node.box[side].max));
      d.radius = (node.box[side].max - d.centre).cwiseMax(d.centre - node.box[side].min).norm();
    }
}

double WindingNumber::operator()(const Vec3& p) const { return sum(p, -1); }
double WindingNumber::without(const Vec3& p, Index triangle) const { return sum(p, triangle); }

double WindingNumber::sum(const Vec3& p, Index skip) const {
  double total = 0;
  if (bvh_.nodes.empty()) return total;
  std::array<Index, bvh_stack_size> stack;
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const Index n = stack[--top];
    const BvhNode& node = bvh_.nodes[n];
    for (int side = 0; side < 2; ++side) {
      if (node.child[side] < 0) continue;
      const Dipole& d = dipoles_[2 * n + side];
      const Vec3 r = d.centre - p;
      const double r2 = r.squaredNorm();
      if (r2 > far_enough * far_enough * d.radius * d.radius) {
        total += d.area.dot(r) / (r2 * std::sqrt(r2)) / (4 * M_PI);
      } else if (node.count[side] == 0) {
        stack[top++] = node.child[side];
      } else {
        for (Index i = node.child[side]; i < node.child[side] + node.count[side]; ++i) {
          const Index t = bvh_.order[i];
          if (t == skip) continue;
          const auto corner = [&](int k) { return Vec3(vertices_.row(triangles_(t, k)).transpose() - p); };
          total += solid_angle(corner(0), corner(1), corner(2));
        }
      }
    }
  }
  return total;
}

}  // namespace palpate::geometry
