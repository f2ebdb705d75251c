// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_scores.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::cli {
namespace {

/// One E with its truth: of the whole object, or of a site of one with regions.
struct Compared {
  double young_modulus_pa = 0, poisson_ratio = 0;
  const MethodAnswer* answer = nullptr;
};

Score score_of(const std::vector<Compared>& all) {
  Score score;
  for (const Compared& one : all) {
    const MethodAnswer& answer = *one.answer;
    if (!std::isfinite(answer.young_modulus_pa)) {
      ++score.without;
      continue;
    }
    const double error = std::log(answer.young_modulus_pa / one.young_modulus_pa), shift = answer.poisson_ratio - one.poisson_ratio;
    ++score.answers;
    score.bias_percent += 100 * error;
    score.rms_percent += 1e4 * error * error;
    score.poisson_bias += shift;
    score.poisson_rms += shift * shift;
    score.solves += answer.solves;
    score.seconds += answer.seconds;
    score.most_load_cases = std::max(score.most_load_cases, answer.load_cases);
    if (!std::isfinite(answer.lower_95_pa)) continue;
    ++score.with_interval;
    score.inside_95 += answer.lower_95_pa <= one.young_modulus_pa && one.young_modulus_pa <= answer.upper_95_pa;
    score.poisson_inside_95 += answer.poisson_lower_95 <= one.poisson_ratio && one.poisson_ratio <= answer.poisson_upper_95;
  }
  const double count = score.answers > 0 ? score.answers : std::numeric_limits<double>::quiet_NaN();
  score.bias_percent /= count;
  score.rms_percent = std::sqrt(score.rms_percent / count);
  score.poisson_bias /= count;
  score.poisson_rms = std::sqrt(score.poisson_rms / count);
  score.solves /= count;
  score.seconds /= count;
  return score;
}

}  // namespace

const TrialAnswer& SceneAnswers::shown() const {
  const auto first = [&](auto wanted) { return std::find_if(trials.begin(), trials.end(), wanted); };
  auto at = first([](const TrialAnswer& trial) { return !trial.samples.empty() || !trial.pictures.empty(); });
  if (at == trials.end()) at = first([](const TrialAnswer& trial) { return trial.failed.empty(); });
  return at == trials.end() ? trials.front() : *at;
}

SceneScores scores_of(const std::vector<TrialAnswer>& trials) {
  std::vector<Compared> paper, coarse, palpate, other;
  for (const TrialAnswer& trial : trials) {
    if (!std::isfinite(trial.young_modulus_pa)) continue;  // the lab made no truth: nobody was asked
    coarse.push_back({trial.young_modulus_pa, trial.poisson_ratio, &trial.paper_coarse});
    if (!trial.other_law.empty()) other.push_back({trial.young_modulus_pa, trial.poisson_ratio, &trial.other});
    if (trial.sites.empty()) {
      paper.push_back({trial.young_modulus_pa, trial.poisson_ratio, &trial.paper});
      palpate.push_back({trial.young_modulus_pa, trial.poisson_ratio, &trial.palpate});
    }
    for (const SiteAnswer& site : trial.sites) {
      paper.push_back({site.young_modulus_pa, trial.poisson_ratio, &site.paper});
      palpate.push_back({site.young_modulus_pa, trial.poisson_ratio, &site.palpate});
    }
  }
  return {score_of(paper), score_of(coarse), score_of(palpate), score_of(other)};
}

std::vector<Claim> claims_of(const std::vector<SceneAnswers>& scenes) {
  std::vector<double> shares;
  std::string worse, dear;
  int inside = 0, intervals = 0;
  for (const SceneAnswers& scene : scenes) {
    if (scene.scene->apparent) continue;
    const SceneScores scores = scores_of(scene.trials);
    const double share = scores.palpate.rms_percent / scores.paper.rms_percent;
    // Without an answer of ours it is worse, without one of theirs it is not.
    shares.push_back(scores.palpate.without > 0 || std::isnan(scores.palpate.rms_percent) ? std::numeric_limits<double>::infinity()
                     : std::isnan(share)                                                  ? 0
                                                                                          : share);
    const std::string name(scene.scene->name);
    if (!(shares.back() < 1)) worse += (worse.empty() ? "" : ", ") + name;
    // The method after the paper asks a simulator at every (E, nu); what it would solve for with unit responses is not its own.
    if (!(scores.palpate.most_load_cases <= 0.2 * scores.paper.solves)) dear += (dear.empty() ? "" : ", ") + name;
    inside += scores.palpate.inside_95;
    intervals += scores.palpate.with_interval;
  }
  if (shares.empty()) return {};
  std::sort(shares.begin(), shares.end());
  const double median = 0.5 * (shares[shares.size() / 2] + shares[(shares.size() - 1) / 2]);
  const double in = intervals > 0 ? 100.0 * inside / intervals : 0;
  return {{"palpate's rms error of E is smaller in every scene", worse.empty(), worse.empty() ? "in all" : "not in: " + worse},
          {"in the median scene it is at most half", median <= 0.5, fmt::format("{:.2f} of the paper's method's", median)},
          {"at least 88 % of the truths lie in palpate's 95 % intervals", in >= 88, fmt::format("{:.0f} % of {}", in, intervals)},
          {"the finite elements are solved for at most a fifth of the load cases that the paper's method simulates", dear.empty(),
           dear.empty() ? "in all" : "not in: " + dear}};
}

}  // namespace palpate::cli
