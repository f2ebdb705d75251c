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

/// Children within `limit` by their lower bounds, nearest first. @returns how many
inline int nearest_first(const WideNode& node, const Eigen::Array4f& bound, float limit, std::array<int, 4>& order) {
  int n = 0;
  for (int i = 0; i < 4; ++i) {
    if (!(bound[i] <= limit) || node.child[i] < 0) continue;
    int at = n++;
    for (; at > 0 && bound[order[at - 1]] > bound[i]; --at) order[at] = order[at - 1];
    order[at] = i;
  }
  return n;
}

/// A ray, prepared: lower bounds of where it enters the four boxes of a node, safe against rounding. Ranges are in units of
/// the direction's largest component, so that neither tiny nor huge directions leave the numbers that a float holds.
class WideRay {
 public:
  WideRay(const WideBvh& wide, const Vec3& origin, const Vec3& direction) : scale_(direction.cwiseAbs().maxCoeff()) {
    const Vec3 o = origin - wide.centre;
    const double error = 2.5e-7 * std::max(wide.extent, o.cwiseAbs().maxCoeff());
    for (int k = 0; k < 3; ++k) {
      const double along = direction[k] / scale_;
      forward_[k] = along >= 0;
      const double inverse = std::min(1 / std::abs(along), 1e30);
      inverse_[k] = Eigen::Array4f::Constant(static_cast<float>(inverse));
      above_[k] = Eigen::Array4f::Constant(static_cast<float>(o[k] + error));
      below_[k] = Eigen::Array4f::Constant(static_cast<float>(o[k] - error));
    }
  }
  /// As a range that `enter` compares with: rounded up.
  float limit(double range) const { return static_cast<float>(std::min(range * scale_ * (1 + 1e-6), 3e38)); }
  /// Infinity where the ray does not meet the box before `limit`.
  Eigen::Array4f enter(const WideNode& n, float limit) const {
    Eigen::Array4f near = Eigen::Array4f::Zero(), far = Eigen::Array4f::Constant(limit);
    for (int k = 0; k < 3; ++k) {
      // A backward ray is a forward one in the mirror.
      const Eigen::Array4f first = forward_[k] ? n.min[k] - above_[k] : below_[k] - n.max[k];
      const Eigen::Array4f last = forward_[k] ? n.max[k] - below_[k] : above_[k] - n.min[k];
      near = near.max(first * inverse_[k] * (1 - 1e-6f));
      far = far.min(last * inverse_[k] * (1 + 1e-6f));
    }
    return (near <= far).select(near, std::numeric_limits<float>::infinity());
  }

 private:
  double scale_;
  std::array<bool, 3> forward_;
  std::array<Eigen::Array4f, 3> inverse_, above_, below_;
};

}  // namespace palpate::geometry
