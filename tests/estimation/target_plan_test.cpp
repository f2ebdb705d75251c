// label: unit
// SPDX-License-Identifier: Apache-2.0
// The fewest pushes to a target, against all orders of made-up pushes tried one by one.
#include "palpate/estimation/target_plan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "palpate/core/error.hpp"

namespace palpate::estimation::target_plan_test {
namespace {

Knowledge nearly_nothing() {
  Knowledge known;
  known.information.diagonal() << 1e-3, 12 / (0.5 * 0.5), 1e4;
  return known;
}

/// Standard deviations of log E and nu that a push alone would leave.
RatedPush push_of(double log_young_std, double poisson_std) {
  RatedPush push;
  push.information = MatrixX::Zero(3, 3);
  push.information.diagonal() << std::pow(log_young_std, -2), std::pow(poisson_std, -2), 0;
  return push;
}

ExpectedSpread after(const Knowledge& known, const std::vector<RatedPush>& pushes, const std::vector<std::size_t>& order) {
  std::vector<const RatedPush*> made;
  for (const std::size_t i : order) made.push_back(&pushes[i]);
  return expected_after(known, made);
}

/// By trying every combination; 0 where `most` are not enough.
int fewest(const Knowledge& known, const std::vector<RatedPush>& pushes, const SpreadTarget& target, int most) {
  for (int n = 1; n <= most; ++n) {
    std::vector<std::size_t> order(static_cast<std::size_t>(n), 0);
    for (;;) {
      if (target.miss(after(known, pushes, order)) <= 1) return n;
      std::size_t digit = 0;
      while (digit < order.size() && order[digit] + 1 == pushes.size()) ++digit;
      if (digit == order.size()) break;
      const std::size_t next = order[digit] + 1;
      std::fill(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(digit) + 1, next);  // never falling: no order twice
    }
  }
  return 0;
}

TEST(TargetPlan, OnePushForEachParameterBeatsTheBestOfBothRepeated) {
  // The first alone has the smallest area; E within 4 % and nu within 0.02 take six of it, or one of each of the others.
  const std::vector<RatedPush> pushes{push_of(0.03, 0.025), push_of(0.015, 0.3), push_of(0.3, 0.009)};
  const SpreadTarget target{0.04, 0.02};
  const TargetPlan plan = plan_for_target(nearly_nothing(), pushes, target, 10);
  ASSERT_TRUE(plan.reached);
  EXPECT_EQ(plan.order.size(), 2u);
  EXPECT_EQ(plan.order[0] + plan.order[1], 3u);
  EXPECT_LE(target.miss(plan.expected), 1);
  const TargetPlan repeated = repeat_for_target(nearly_nothing(), pushes, target, 20);
  ASSERT_TRUE(repeated.reached);
  EXPECT_EQ(repeated.order.front(), 0u);
  EXPECT_GE(repeated.order.size(), 5u);
}

TEST(TargetPlan, IsAsShortAsTheShortestOfAllCombinations) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  int longest = 0;
  for (int trial = 0; trial < 60; ++trial) {
    std::vector<RatedPush> pushes;
    for (int i = 0; i < 5; ++i) {
      RatedPush push = push_of(0.02 * std::exp(1.5 * uniform(random)), 0.01 * std::exp(2 * uniform(random)));
      const double both = (2 * uniform(random) - 1) * std::sqrt(push.information(0, 0) * push.information(1, 1));
      push.information(0, 1) = push.information(1, 0) = 0.8 * both;
      pushes.push_back(push);
    }
    const SpreadTarget target{0.03 + 0.03 * uniform(random), 0.015 + 0.01 * uniform(random)};
    const TargetPlan plan = plan_for_target(nearly_nothing(), pushes, target, 6);
    const int best = fewest(nearly_nothing(), pushes, target, 6);
    EXPECT_EQ(plan.reached ? static_cast<int>(plan.order.size()) : 0, best) << "trial " << trial;
    EXPECT_NEAR(plan.expected.poisson_std, after(nearly_nothing(), pushes, plan.order).poisson_std, 1e-12);
    longest = std::max(longest, best);
  }
  EXPECT_GE(longest, 4) << "else nothing was asked";
}

TEST(TargetPlan, WithThreeRegionsItIsAsShortAsTheShortestOfAllCombinations) {
  // (log E of the first, nu, two log ratios, force scale); a push tells of the stiffness of one region, and of nu.
  Knowledge known;
  known.regions = {"head", "belly", "back"};
  known.log_ratio = VectorX::Zero(2);
  known.information = MatrixX::Zero(5, 5);
  known.information.diagonal() << 1e-3, 12 / (0.5 * 0.5), 0.19, 0.19, 1e4;
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(0, 1);
  int longest = 0, missed = 0;
  for (int trial = 0; trial < 40; ++trial) {
    std::vector<RatedPush> pushes;
    for (int i = 0; i < 7; ++i) {
      RatedPush push;
      push.region = i % 3;
      push.information = MatrixX::Zero(5, 5);
      const double young_std = 0.02 * std::exp(uniform(random)), poisson_std = 0.01 * std::exp(2 * uniform(random));
      VectorX row = VectorX::Zero(5);
      row(0) = 1;
      if (push.region > 0) row(1 + push.region) = 1;
      push.information = row * row.transpose() / (young_std * young_std);
      push.information(1, 1) = 1 / (poisson_std * poisson_std);
      pushes.push_back(push);
    }
    const SpreadTarget target{0.04 + 0.04 * uniform(random), 0.015 + 0.01 * uniform(random)};
    const TargetPlan plan = plan_for_target(known, pushes, target, 7);
    const int best = fewest(known, pushes, target, 7);
    const int found = plan.reached ? static_cast<int>(plan.order.size()) : 0;
    if (best > 0) {
      EXPECT_LE(found, best + 1) << "trial " << trial;
    }
    missed += found != best;
    longest = std::max(longest, best);
  }
  EXPECT_LE(missed, 2);
  EXPECT_GE(longest, 5) << "else nothing was asked";
}

TEST(TargetPlan, OutOfReachItComesAsNearAsItCan) {
  const std::vector<RatedPush> pushes{push_of(0.03, 0.025), push_of(0.015, 0.3)};
  Knowledge coarse = nearly_nothing();
  coarse.uncured = Vec2(0.03 * 0.03, 0).asDiagonal();  // the mesh's: no push takes it away
  const SpreadTarget target{0.04, 0.02};
  const TargetPlan plan = plan_for_target(coarse, pushes, target, 4);
  EXPECT_FALSE(plan.reached);
  EXPECT_EQ(plan.order.size(), 4u);
  EXPECT_GT(target.miss(plan.expected), 1);
  EXPECT_TRUE(repeat_for_target(coarse, pushes, target, 50).order.empty());
}

TEST(TargetPlan, NothingToChooseFromAndBadTargets) {
  EXPECT_TRUE(plan_for_target(nearly_nothing(), {}, {}, 3).order.empty());
  EXPECT_THROW(plan_for_target(nearly_nothing(), {}, {0, 0.03}, 3), Error);
  EXPECT_THROW(plan_for_target(nearly_nothing(), {}, {0.05, std::nan("")}, 3), Error);
}

// Two pushes are needed, one for E and one for nu, among useless ones. The later of two places out of five is the second with a
// chance of 1 in 10, the third with 2, the fourth with 3 and the fifth with 4: the fourth in the middle. Out of three: the third.
TEST(TargetPlan, AShuffledListNeedsWhatChanceSays) {
  const SpreadTarget target{0.04, 0.02};
  std::vector<RatedPush> pushes{push_of(0.015, 0.3), push_of(0.3, 0.009), push_of(1, 1)};
  EXPECT_EQ(shuffled_for_target(nearly_nothing(), pushes, target, 20, 1), 3);
  pushes.push_back(push_of(1, 1));
  pushes.push_back(push_of(1, 1));
  EXPECT_EQ(shuffled_for_target(nearly_nothing(), pushes, target, 20, 1), 4);
  EXPECT_EQ(shuffled_for_target(nearly_nothing(), pushes, target, 3, 1), std::nullopt) << "more than three";
  EXPECT_EQ(shuffled_for_target(nearly_nothing(), {push_of(1, 1)}, target, 20, 1), std::nullopt);
  // One that does it in two, over and over: the list begins anew at its end.
  EXPECT_EQ(shuffled_for_target(nearly_nothing(), {push_of(0.025, 0.013)}, target, 20, 1), 2);
}

}  // namespace
}  // namespace palpate::estimation::target_plan_test
