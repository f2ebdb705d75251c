// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/aggregates.hpp"

#include <algorithm>
#include <numeric>

namespace palpate::fem {

Aggregates aggregate(const QuotientGraph& graph, const UnknownPlacement& placement, Index largest) {
  const Index groups = graph.group_count();
  Aggregates result;
  result.order.resize(static_cast<std::size_t>(groups));
  std::iota(result.order.begin(), result.order.end(), 0);
  result.begin.push_back(0);
  const auto point = [&](Index group) {
    return placement.point_m.row(graph.first_unknown[static_cast<std::size_t>(group)]);
  };
  const auto halve = [&](auto&& self, Index first, Index last) -> void {
    if (last - first <= largest) {
      result.begin.push_back(last);
      return;
    }
    const auto from = result.order.begin() + first, to = result.order.begin() + last;
    Eigen::RowVector3d low = point(*from), high = low;
    for (auto it = from; it != to; ++it) {
      low = low.cwiseMin(point(*it));
      high = high.cwiseMax(point(*it));
    }
    Eigen::Index axis = 0;
    (high - low).maxCoeff(&axis);
    const Index middle = first + (last - first) / 2;
    // Ties are broken by number: the halves do not depend on how the library selects.
    std::nth_element(from, result.order.begin() + middle, to, [&](Index a, Index b) {
      const double x = point(a)(axis), y = point(b)(axis);
      return x != y ? x < y : a < b;
    });
    self(self, first, middle);
    self(self, middle, last);
  };
  if (placement.empty()) {
    for (Index first = largest; first < groups; first += largest) result.begin.push_back(first);
    if (groups > 0) result.begin.push_back(groups);
  } else if (groups > 0) {
    halve(halve, 0, groups);
  }
  for (Index a = 0; a < result.count(); ++a) {  // mesh order inside an aggregate
    std::sort(result.order.begin() + result.begin[static_cast<std::size_t>(a)],
              result.order.begin() + result.begin[static_cast<std::size_t>(a) + 1]);
  }
  return result;
}

}  // namespace palpate::fem
