// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/next_push.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/estimation/push_information.hpp"

namespace palpate::estimation {
namespace {

constexpr double known_exactly = 1e12;  // information of what is fixed

ExpectedSpread spread_of(const MatrixX& information, const Eigen::Vector2d& uncured) {
  ExpectedSpread spread;
  // Nothing of E is known before the first touch: that row has no inverse.
  if (!(information(0, 0) > 0)) {
    spread.log_young_std = std::numeric_limits<double>::infinity();
    spread.poisson_std = information(1, 1) > 0 ? std::sqrt(1 / information(1, 1) + uncured(1)) : spread.log_young_std;
    return spread;
  }
  const MatrixX covariance = information.ldlt().solve(MatrixX::Identity(3, 3));
  const double young = covariance(0, 0) + uncured(0), ratio = covariance(1, 1) + uncured(1);
  spread.log_young_std = std::sqrt(std::max(young, 0.0));
  spread.poisson_std = std::sqrt(std::max(ratio, 0.0));
  spread.correlation = young > 0 && ratio > 0 ? covariance(0, 1) / std::sqrt(young * ratio) : 0;
  return spread;
}

}  // namespace

PushGoal push_goal(const std::string& name) {
  if (name == "young-modulus") return PushGoal::young_modulus;
  if (name == "poisson-ratio") return PushGoal::poisson_ratio;
  if (name == "both") return PushGoal::both;
  throw Error("pushes are planned for young-modulus, poisson-ratio or both", "goal " + name);
}

double ExpectedSpread::score(PushGoal goal) const {
  if (goal == PushGoal::young_modulus) return log_young_std;
  if (goal == PushGoal::poisson_ratio) return poisson_std;
  return log_young_std * poisson_std * std::sqrt(std::max(1e-12, 1 - correlation * correlation));
}

Knowledge before_touch(const Recording& recording, double young_modulus_pa) {
  if (!(young_modulus_pa > 0)) throw Error("must be positive", "young_modulus_pa");
  Knowledge known;
  known.young_modulus_pa = young_modulus_pa;
  const ModelDefaults& model = recording.model;
  known.poisson_ratio = model.poisson_fixed.value_or(std::clamp(0.3, model.poisson_lower, model.poisson_upper));
  const double range = model.poisson_upper - model.poisson_lower;
  known.information(1, 1) = model.poisson_fixed || !(range > 0) ? known_exactly : 12 / (range * range);
  known.information(2, 2) = recording.force_scale_std > 0 ? std::pow(recording.force_scale_std, -2) : known_exactly;
  return known;
}

Knowledge after_fit(const Recording& recording, const Identification& answer) {
  int young = -1, ratio = -1;
  for (std::size_t i = 0; i < answer.parameters.size(); ++i) {
    if (!answer.parameters[i].region.empty()) continue;
    if (answer.parameters[i].name == "young_modulus") young = static_cast<int>(i);
    if (answer.parameters[i].name == "poisson_ratio") ratio = static_cast<int>(i);
  }
  if (young < 0 || ratio < 0)
    throw Error("holds no Young's modulus and Poisson ratio of the whole object", "result: parameters");
  if (answer.covariance.rows() <= std::max(young, ratio) || !answer.covariance.allFinite() ||
      !(answer.covariance(young, young) > 0))
    throw Error("holds no covariance; estimate with the default method", "result: covariance");
  const auto at = [&](int i) { return static_cast<std::size_t>(i); };
  Knowledge known;
  known.touched = true;
  known.young_modulus_pa = answer.parameters[at(young)].value;
  known.poisson_ratio = std::clamp(answer.parameters[at(ratio)].value, 0.0, 0.499);
  Eigen::Matrix2d covariance;
  covariance << answer.covariance(young, young), answer.covariance(young, ratio), answer.covariance(young, ratio),
      answer.covariance(ratio, ratio);
  const bool fixed = recording.model.poisson_fixed || !(covariance(1, 1) > 0);
  if (fixed) covariance(1, 0) = covariance(0, 1) = 0, covariance(1, 1) = 1 / known_exactly;

  // The mesh's error comes back with every push, and none shows the unseen side or the foot. Its sign of correlation is not told, so it goes out of the diagonal.
  for (const auto& entry : answer.budget) {
    if (entry.input != "mesh" && entry.input != "unseen side" && entry.input != "foot") continue;
    known.uncured(0) += std::pow(entry.young_modulus_percent / 100, 2);
    known.uncured(1) += fixed ? 0 : entry.poisson_shift * entry.poisson_shift;
  }
  for (int i = 0; i < 2; ++i) known.uncured(i) = std::min(known.uncured(i), 0.9 * covariance(i, i));
  const double left = std::sqrt((1 - known.uncured(0) / covariance(0, 0)) * (1 - known.uncured(1) / covariance(1, 1)));
  covariance.diagonal() -= known.uncured;
  covariance(0, 1) *= left;
  covariance(1, 0) *= left;

  // E is proportional to the force: d log E / d scale = 1 exactly.
  double scale_std = recording.force_scale_std;
  for (const auto& nuisance : answer.nuisances)
    if (nuisance.name == "force_scale") scale_std = std::min(scale_std, nuisance.std);
  const double scale = std::min(scale_std * scale_std, 0.9 * covariance(0, 0));
  MatrixX joint = MatrixX::Zero(3, 3);
  joint.topLeftCorner(2, 2) = covariance;
  joint(2, 2) = scale > 0 ? scale : 1 / known_exactly;
  joint(0, 2) = joint(2, 0) = scale;
  known.information = joint.fullPivLu().inverse();
  return known;
}

ExpectedSpread expected_after(const Knowledge& knowledge, const std::vector<const RatedPush*>& pushes) {
  MatrixX information = knowledge.information;
  for (const RatedPush* push : pushes) information += push->information;
  return spread_of(information, knowledge.uncured);
}

PushRanking rank_pushes(const Recording& scene, const SimulatedObject& object, const std::string& tool,
                        const std::vector<PushCandidate>& candidates, const SensorPlan& sensors, const Knowledge& knowledge,
                        const RankOptions& options, const OnProgress& progress) {
  PushRanking ranking;
  ranking.knowledge = knowledge;
  ranking.goal = options.goal;
  ranking.so_far = expected_after(knowledge, {});
  if (candidates.empty()) return ranking;
  PushInformation information(scene, object, tool, candidates, sensors, knowledge, options);
  ranking.too_soft = information.left_out();
  for (std::size_t c = 0; c < information.count(); ++c) {
    if (progress && !progress("rate pushes", static_cast<double>(c) / static_cast<double>(information.count()))) break;
    std::vector<RatedPush> rated = information.rate(c);
    if (rated.empty()) ++ranking.out_of_view;
    for (RatedPush& push : rated) {
      push.expected = expected_after(knowledge, {&push});
      ranking.pushes.push_back(std::move(push));
    }
  }
  std::stable_sort(ranking.pushes.begin(), ranking.pushes.end(), [&](const RatedPush& a, const RatedPush& b) {
    return a.expected.score(options.goal) < b.expected.score(options.goal);
  });
  return ranking;
}

std::vector<std::size_t> hardest_pushes(const PushRanking& ranking) {
  std::vector<std::size_t> hardest;
  for (std::size_t i = 0; i < ranking.pushes.size(); ++i) {
    const RatedPush& push = ranking.pushes[i];
    const auto same = std::find_if(hardest.begin(), hardest.end(), [&](std::size_t known) {
      const PushCandidate& at = ranking.pushes[known].candidate;
      return at.contact_m == push.candidate.contact_m && at.direction == push.candidate.direction;
    });
    if (same == hardest.end())
      hardest.push_back(i);
    else if (push.steps > ranking.pushes[*same].steps)
      *same = i;
  }
  return hardest;
}

std::vector<std::size_t> plan_sequence(const PushRanking& ranking, int count) {
  std::vector<std::size_t> order;
  std::vector<const RatedPush*> made;
  for (int n = 0; n < count && !ranking.pushes.empty(); ++n) {
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < ranking.pushes.size(); ++i) {
      made.push_back(&ranking.pushes[i]);
      const double score = expected_after(ranking.knowledge, made).score(ranking.goal);
      made.pop_back();
      if (score < least) least = score, best = i;
    }
    order.push_back(best);
    made.push_back(&ranking.pushes[best]);
  }
  return order;
}

}  // namespace palpate::estimation
