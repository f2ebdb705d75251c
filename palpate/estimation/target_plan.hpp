// SPDX-License-Identifier: Apache-2.0
// The fewest pushes after which the intervals of E and of nu are as narrow as was asked for. The best next push alone is not
// the first of them where E and nu want different places.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "palpate/estimation/next_push.hpp"

namespace palpate::estimation {

/// Half widths of 95 % intervals, of E relative to it (in regions: of every E).
struct SpreadTarget {
  double young_modulus_within = 0.05, poisson_ratio_within = 0.03;
  /// The worse of both half widths over what was asked for; at most 1 where the target is reached.
  double miss(const ExpectedSpread& spread) const;
  double young_miss(double log_young_std) const;   ///< of one E
  double poisson_miss(double poisson_std) const;
};

struct TargetPlan {
  std::vector<std::size_t> order;  ///< indices of the pushes; the same one may come again
  ExpectedSpread expected;         ///< after all of them
  bool reached = false;
};

/// Tried are every push and every pair of pushes, each repeated, and two greedy orders over all of them; of an object in
/// regions those orders with one push less, for as long as exchanges of one or two pushes keep the target. Among plans of the
/// same length the one that leaves the most room wins, and the push that says the most comes first.
/// @param most  longest plan; where the target is out of its reach, the plan is the greedy one that comes nearest
/// @throws Error on targets that are not positive.
TargetPlan plan_for_target(const Knowledge& knowledge, const std::vector<RatedPush>& pushes, const SpreadTarget& target,
                           int most);

/// The one push that needs to be repeated least, for comparison.
TargetPlan repeat_for_target(const Knowledge& knowledge, const std::vector<RatedPush>& pushes, const SpreadTarget& target,
                             int most);

/// How many pushes a list takes that was shuffled before the first of them and begins anew at its end: the number in the middle
/// of many shuffles, of an even number the larger one. Nothing: more than `most`.
std::optional<int> shuffled_for_target(const Knowledge& knowledge, const std::vector<RatedPush>& pushes, const SpreadTarget& target,
                                       int most, std::uint64_t seed);

}  // namespace palpate::estimation
