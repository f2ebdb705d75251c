// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::geometry {

/// Which of the numbers 0 to count - 1 hang together. (Tarjan, "Efficiency of a good but not linear set union algorithm",
/// J. ACM 1975; paths are halved.)
class UnionFind {
 public:
  explicit UnionFind(Eigen::Index count) : up_(static_cast<std::size_t>(count)) { std::iota(up_.begin(), up_.end(), Index{0}); }
  /// The smallest number that hangs together with this one.
  Index root(Index i) {
    while (up_[i] != i) i = up_[i] = up_[up_[i]];
    return i;
  }
  void join(Index a, Index b) {
    a = root(a), b = root(b);
    up_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<Index> up_;
};

}  // namespace palpate::geometry
