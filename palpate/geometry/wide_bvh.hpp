// SPDX-License-Identifier: Apache-2.0
// Inside of TriangleTree: the same hierarchy with four children a node, whose boxes are tested together in single precision.
#pragma once

#include <Eigen/Core>
#include <array>
#include <utility>
#include <vector>

#include "palpate/geometry/bvh.hpp"

namespace palpate::geometry {

/// Boxes are relative to `centre` and rounded outwards, so that a lower bound of the distance stays one.
struct alignas(16) WideNode {
  std::array<Eigen::Array4f, 3> min, max;
  std::array<Index, 4> child{-1, -1, -1, -1};  ///< as in BvhNode; -1 = nothing there (its box is infinitely far)
  std::array<Index, 4> count{0, 0, 0, 0};
};

struct WideBvh {
  std::vector<WideNode> nodes;
  std::vector<std::array<std::pair<Index, int>, 4>>
      source;  ///< node and side of the binary hierarchy that a child came from
  Vec3 centre = Vec3::Zero();
  double extent = 0;  ///< largest coordinate relative to the centre
};

WideBvh widen(const Bvh& bvh);

/// Takes the boxes of the refitted binary hierarchy.
void copy_boxes(WideBvh& wide, const Bvh& bvh);

/// A query point, prepared: lower bounds of squared distances to the four boxes of a node, safe against rounding.
class WideQuery {
 public:
  WideQuery(const WideBvh& wide, const Vec3& point) {
    const Vec3 p = point - wide.centre;
    // of rounding the point to float, and of the subtraction
    const double error = 2.5e-7 * std::max(wide.extent, p.cwiseAbs().maxCoeff());
    for (int k = 0; k < 3; ++k) {
      above_[k] = Eigen::Array4f::Constant(static_cast<float>(p[k] + error));
      below_[k] = Eigen::Array4f::Constant(static_cast<float>(p[k] - error));
    }
  }
  Eigen::Array4f squared(const WideNode& n) const {
    const Eigen::Array4f zero = Eigen::Array4f::Zero();
    const Eigen::Array4f x = (n.min[0] - above_[0]).max(below_[0] - n.max[0]).max(zero);
    const Eigen::Array4f y = (n.min[1] - above_[1]).max(below_[1] - n.max[1]).max(zero);
    const Eigen::Array4f z = (n.min[2] - above_[2]).max(below_[2] - n.max[2]).max(zero);
    return (x * x + y * y + z * z) * (1 - 1e-6f);
  }

 private:
  std::array<Eigen::Array4f, 3> above_, below_;
};

}  // namespace palpate::geometry
