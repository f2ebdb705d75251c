// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/target_plan.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "palpate/core/error.hpp"

namespace palpate::estimation {
namespace {

constexpr double normal_975 = 1.959964;
constexpr double noticeable = 1 - 1e-9;  // of what an exchange leaves; else rounding would go on for ever

/// Counts of pushes a and b.
struct Mix {
  std::size_t a = 0, b = 0;
  int of_a = 0, of_b = 0;
};

class Planner {
 public:
  Planner(const Knowledge& knowledge, const std::vector<RatedPush>& pushes, const SpreadTarget& target)
      : knowledge_(knowledge), pushes_(pushes), target_(target) {
    if (!(target.young_modulus_within > 0)) throw Error("must be positive", "SpreadTarget.young_modulus_within");
    if (!(target.poisson_ratio_within > 0)) throw Error("must be positive", "SpreadTarget.poisson_ratio_within");
  }

  /// Each push the best after those before it, until the target is reached.
  template <class Score>
  TargetPlan greedy(int most, Score score) const {
    TargetPlan plan;
    MatrixX information = knowledge_.information;
    for (int n = 0; n < most && !plan.reached && !pushes_.empty(); ++n) {
      std::size_t best = 0;
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < pushes_.size(); ++i) {
        const double s = score(spread(information + pushes_[i].information));
        if (s < least) least = s, best = i;
      }
      information += pushes_[best].information;
      plan.order.push_back(best);
      plan.expected = spread(information);
      plan.reached = target_.miss(plan.expected) <= 1;
    }
    return plan;
  }

  /// A plan that is one push shorter, for as long as leaving one out and exchanging the others finds one.
  TargetPlan shortened(TargetPlan plan) const {
    if (!plan.reached) exchange(plan);
    while (plan.reached && plan.order.size() > 1) {
      TargetPlan shorter;
      for (std::size_t k = 0; k < plan.order.size() && !shorter.reached; ++k) {
        shorter.order = plan.order;
        shorter.order.erase(shorter.order.begin() + static_cast<std::ptrdiff_t>(k));
        exchange(shorter);
      }
      if (!shorter.reached) break;
      plan = shorter;
    }
    return plan;
  }

  /// Pushes of a given order until the target is reached; most + 1 where they do not.
  int of_list(const std::vector<std::size_t>& list, int most) const {
    MatrixX information = knowledge_.information;
    for (int n = 1; n <= most; ++n) {
      information += pushes_[list[static_cast<std::size_t>(n - 1) % list.size()]].information;
      if (target_.miss(spread(information)) <= 1) return n;
    }
    return most + 1;
  }

  /// The shortest plan of at most `most` pushes out of one or two of them.
  TargetPlan mixed(int most, bool one_place) const {
    for (int n = 1; n <= most; ++n) {
      Mix best;
      double least = 1;
      const auto consider = [&](const Mix& mix) {
        const double miss = target_.miss(spread(information(mix)));
        if (miss <= least) least = miss, best = mix;
      };
      for (std::size_t a = 0; a < pushes_.size(); ++a) {
        consider({a, a, n, 0});
        for (std::size_t b = a + 1; b < pushes_.size() && !one_place; ++b)
          for (int of_b = 1; of_b < n; ++of_b) consider({a, b, n - of_b, of_b});
      }
      if (best.of_a > 0) return planned(best);
    }
    return {};
  }

 private:
  /// What exchanges make smaller: where several intervals are too wide, narrowing any of them helps.
  double excess(const MatrixX& information) const {
    const ExpectedSpread then = spread(information);
    double sum = std::pow(target_.poisson_miss(then.poisson_std), 8);
    for (const double std : then.region_log_young_std) sum += std::pow(target_.young_miss(std), 8);
    return sum;
  }

  /// Replaces pushes, one or two at a time, by those that leave the least to be wished for, until none do.
  void exchange(TargetPlan& plan) const {
    for (;;) {
      plan.expected = spread(information(plan.order));
      plan.reached = target_.miss(plan.expected) <= 1;
      if (plan.reached || !(exchanged_one(plan.order) || exchanged_two(plan.order))) return;
    }
  }

  bool exchanged_one(std::vector<std::size_t>& order) const {
    const MatrixX all = information(order);
    std::vector<std::size_t> best;
    double least = noticeable * excess(all);
    for (std::size_t k = 0; k < order.size(); ++k) {
      const MatrixX others = all - pushes_[order[k]].information;
      for (std::size_t i = 0; i < pushes_.size(); ++i) {
        const double left = excess(others + pushes_[i].information);
        if (left >= least) continue;
        least = left;
        best = order;
        best[k] = i;
      }
    }
    if (!best.empty()) order = best;
    return !best.empty();
  }

  /// Out of the pushes that would help most as one more; of a long plan there are too many pairs.
  bool exchanged_two(std::vector<std::size_t>& order) const {
    constexpr std::size_t tried = 24, longest = 10;
    if (order.size() > longest) return false;
    const MatrixX all = information(order);
    std::vector<std::pair<double, std::size_t>> helpful;
    for (std::size_t i = 0; i < pushes_.size(); ++i) helpful.emplace_back(excess(all + pushes_[i].information), i);
    std::sort(helpful.begin(), helpful.end());
    helpful.resize(std::min(helpful.size(), tried));
    std::vector<std::size_t> best;
    double least = noticeable * excess(all);
    for (std::size_t k = 0; k < order.size(); ++k) {
      for (std::size_t l = k + 1; l < order.size(); ++l) {
        const MatrixX others = all - pushes_[order[k]].information - pushes_[order[l]].information;
        for (std::size_t i = 0; i < helpful.size(); ++i) {
          for (std::size_t j = i; j < helpful.size(); ++j) {
            const std::size_t a = helpful[i].second, b = helpful[j].second;
            const double left = excess(others + pushes_[a].information + pushes_[b].information);
            if (left >= least) continue;
            least = left;
            best = order;
            best[k] = a, best[l] = b;
          }
        }
      }
    }
    if (!best.empty()) order = best;
    return !best.empty();
  }

  MatrixX information(const std::vector<std::size_t>& order) const {
    MatrixX sum = knowledge_.information;
    for (const std::size_t i : order) sum += pushes_[i].information;
    return sum;
  }
  ExpectedSpread spread(const MatrixX& information) const {
    Knowledge then = knowledge_;
    then.information = information;
    return expected_after(then, {});
  }
  MatrixX information(const Mix& mix) const {
    return knowledge_.information + mix.of_a * pushes_[mix.a].information + mix.of_b * pushes_[mix.b].information;
  }
  TargetPlan planned(Mix mix) const {
    const auto alone = [&](std::size_t i) {
      return expected_after(knowledge_, {&pushes_[i]}).score(PushGoal::both);
    };
    if (mix.of_b > 0 && alone(mix.b) < alone(mix.a)) std::swap(mix.a, mix.b), std::swap(mix.of_a, mix.of_b);
    TargetPlan plan;
    plan.order.assign(static_cast<std::size_t>(mix.of_a), mix.a);
    plan.order.insert(plan.order.end(), static_cast<std::size_t>(mix.of_b), mix.b);
    plan.expected = spread(information(mix));
    plan.reached = true;
    return plan;
  }

  const Knowledge& knowledge_;
  const std::vector<RatedPush>& pushes_;
  const SpreadTarget& target_;
};

}  // namespace

double SpreadTarget::young_miss(double log_young_std) const {
  // Half of the interval over E is sinh(1.96 std of log E).
  return std::sinh(normal_975 * std::min(log_young_std, 100.0)) / young_modulus_within;
}

double SpreadTarget::poisson_miss(double poisson_std) const { return normal_975 * poisson_std / poisson_ratio_within; }

double SpreadTarget::miss(const ExpectedSpread& spread) const {
  return std::max(young_miss(spread.log_young_std), poisson_miss(spread.poisson_std));
}

TargetPlan plan_for_target(const Knowledge& knowledge, const std::vector<RatedPush>& pushes, const SpreadTarget& target,
                           int most) {
  const Planner planner(knowledge, pushes, target);
  TargetPlan best = planner.greedy(most, [&](const ExpectedSpread& s) { return target.miss(s); });
  const auto take_better = [&](const TargetPlan& plan) {
    const double miss = target.miss(plan.expected), least = target.miss(best.expected);
    const bool shorter = plan.order.size() < best.order.size();
    const bool better = plan.reached && best.reached ? shorter || (plan.order.size() == best.order.size() && miss < least)
                                                     : plan.reached || (!best.reached && miss < least);
    if (better) best = plan;
  };
  if (best.order.empty()) return best;
  take_better(planner.greedy(most, [](const ExpectedSpread& s) { return s.score(PushGoal::both); }));
  if (knowledge.regions.size() > 1) take_better(planner.shortened(best));
  if (knowledge.regions.size() > 2) return best;  // two places are not enough
  const int to_beat = best.reached ? static_cast<int>(best.order.size()) : most;
  const TargetPlan mixed = planner.mixed(to_beat, false);
  if (mixed.reached) take_better(mixed);
  return best;
}

TargetPlan repeat_for_target(const Knowledge& knowledge, const std::vector<RatedPush>& pushes, const SpreadTarget& target,
                             int most) {
  return Planner(knowledge, pushes, target).mixed(most, true);
}

std::optional<int> shuffled_for_target(const Knowledge& knowledge, const std::vector<RatedPush>& pushes, const SpreadTarget& target,
                                       int most, std::uint64_t seed) {
  constexpr std::size_t shuffles = 200;
  if (pushes.empty()) return std::nullopt;
  const Planner planner(knowledge, pushes, target);
  std::mt19937_64 random(seed);
  std::vector<std::size_t> list(pushes.size());
  for (std::size_t i = 0; i < list.size(); ++i) list[i] = i;
  std::vector<int> needed;
  for (std::size_t k = 0; k < shuffles; ++k) {
    for (std::size_t i = list.size(); i > 1; --i) std::swap(list[i - 1], list[random() % i]);
    needed.push_back(planner.of_list(list, most));
  }
  std::sort(needed.begin(), needed.end());
  const int middle = needed[shuffles / 2];
  return middle <= most ? std::optional(middle) : std::nullopt;
}

}  // namespace palpate::estimation
