// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_scores.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "cli/paper_words.hpp"

namespace palpate::cli {
namespace {

constexpr double no_score = std::numeric_limits<double>::quiet_NaN();

/// One E with its truth: of the whole object, or of a site of one with regions.
struct Compared {
  double young_modulus_pa = 0, poisson_ratio = 0;
  const MethodAnswer* answer = nullptr;
};

/// What a seed took.
struct Effort {
  int solves = 0, load_cases = 0;
  double seconds = 0;
  void add(const MethodAnswer& answer) { solves += answer.solves, load_cases += answer.load_cases, seconds += answer.seconds; }
};

bool answered(const MethodAnswer& answer) { return std::isfinite(answer.young_modulus_pa); }

/// Mean, spread about it and root mean square.
struct Moments {
  double sum = 0, squares = 0;
  int count = 0;
  void add(double x) { sum += x, squares += x * x, ++count; }
  double mean() const { return count > 0 ? sum / count : no_score; }
  double rms() const { return count > 0 ? std::sqrt(squares / count) : no_score; }
  double spread() const { return count > 1 ? std::sqrt(std::max(0.0, squares - sum * sum / count) / (count - 1)) : no_score; }
};

Score score_of(const std::vector<Compared>& all, const std::vector<Effort>& efforts) {
  Score score;
  Moments young, near, poisson, solves;
  std::vector<double> sizes, seconds;
  for (const Compared& one : all) {
    const MethodAnswer& answer = *one.answer;
    ++score.asked;
    if (!answered(answer)) {
      ++score.without;
      continue;
    }
    ++score.answers;
    const double off_percent = 100 * std::log(answer.young_modulus_pa / one.young_modulus_pa);
    young.add(off_percent);
    sizes.push_back(std::abs(off_percent));
    if (std::abs(off_percent) > 100 * std::log(10.0))
      ++score.far_off;
    else
      near.add(off_percent);
    poisson.add(answer.poisson_ratio - one.poisson_ratio);
    if (!std::isfinite(answer.lower_95_pa)) continue;
    ++score.with_interval;
    score.inside_95 += answer.lower_95_pa <= one.young_modulus_pa && one.young_modulus_pa <= answer.upper_95_pa;
    score.poisson_inside_95 += answer.poisson_lower_95 <= one.poisson_ratio && one.poisson_ratio <= answer.poisson_upper_95;
  }
  for (const Effort& effort : efforts) {
    solves.add(effort.solves);
    seconds.push_back(effort.seconds);
    score.most_load_cases = std::max(score.most_load_cases, effort.load_cases);
  }
  score.median_percent = median(sizes);
  score.bias_percent = young.mean(), score.spread_percent = young.spread(), score.rms_percent = young.rms();
  score.near_bias_percent = near.mean(), score.near_rms_percent = near.rms();
  score.poisson_bias = poisson.mean(), score.poisson_spread = poisson.spread(), score.poisson_rms = poisson.rms();
  score.solves = solves.mean(), score.seconds = median(seconds);
  return score;
}

/// Of one method over the trials.
struct Answers {
  std::vector<Compared> compared;
  std::vector<Effort> efforts;
  void add(const TrialAnswer& trial, const MethodAnswer& answer) {
    compared.push_back({trial.young_modulus_pa, trial.poisson_ratio, &answer});
    if (!answered(answer)) return;
    efforts.emplace_back().add(answer);
    // The fit with the other law is of the samples that this one left: it took both.
    if (&answer == &trial.other) efforts.back().add(trial.palpate);
  }
  void add(const StudyRow& row, const MethodAnswer& answer) {
    if (!answered(answer) && answer.failed.empty() && answer.verdicts.empty()) return;
    compared.push_back({row.young_modulus_pa, row.poisson_ratio, &answer});
    if (answered(answer)) efforts.emplace_back().add(answer);
  }
  Score score() const { return score_of(compared, efforts); }
};

/// Both methods on an object with regions: ours answers for all sites at once, the paper's for each by itself.
void add_sites(const TrialAnswer& trial, Answers& paper, Answers& palpate, Answers& paper_compared, Answers& palpate_compared, int& apart) {
  Effort by_paper, by_palpate;
  by_palpate.add(trial.palpate);
  bool all = true;
  for (const SiteAnswer& site : trial.sites) {
    const Compared theirs{site.young_modulus_pa, trial.poisson_ratio, &site.paper}, ours{site.young_modulus_pa, trial.poisson_ratio, &site.palpate};
    by_paper.add(site.paper);
    paper.compared.push_back(theirs);
    palpate.compared.push_back(ours);
    if (answered(site.paper)) {
      paper_compared.compared.push_back(theirs);
      palpate_compared.compared.push_back(ours);
    } else {
      ++apart;
      all = false;
    }
  }
  if (all) paper.efforts.push_back(by_paper), paper_compared.efforts.push_back(by_paper);
  if (answered(trial.palpate)) palpate.efforts.push_back(by_palpate);
  if (all && answered(trial.palpate)) palpate_compared.efforts.push_back(by_palpate);
}

std::string also(const std::string& names, const std::string& one) { return names + (names.empty() ? "" : ", ") + one; }

}  // namespace

const TrialAnswer& SceneAnswers::shown() const {
  const auto first = [&](auto wanted) { return std::find_if(trials.begin(), trials.end(), wanted); };
  auto at = first([](const TrialAnswer& trial) { return !trial.samples.empty() || !trial.pictures.empty(); });
  if (at == trials.end()) at = first([](const TrialAnswer& trial) { return trial.failed.empty(); });
  return at == trials.end() ? trials.front() : *at;
}

const MethodAnswer& counted(const TrialAnswer& trial) { return trial.other_law.empty() ? trial.palpate : trial.other; }

SceneScores scores_of(const std::vector<TrialAnswer>& trials) {
  Answers paper, coarse, palpate, same_law, paper_compared, palpate_compared;
  SceneScores out;
  for (const TrialAnswer& trial : trials) {
    if (!std::isfinite(trial.young_modulus_pa)) continue;  // the lab made no truth: nobody was asked
    coarse.add(trial, trial.paper_coarse);
    if (!trial.other_law.empty()) same_law.add(trial, trial.palpate);
    if (!trial.sites.empty()) {
      add_sites(trial, paper, palpate, paper_compared, palpate_compared, out.apart);
      continue;
    }
    paper.add(trial, trial.paper);
    palpate.add(trial, counted(trial));
    if (!answered(trial.paper)) {
      ++out.apart;
      continue;
    }
    paper_compared.add(trial, trial.paper);
    palpate_compared.add(trial, counted(trial));
  }
  out.paper = paper.score(), out.paper_coarse = coarse.score(), out.palpate = palpate.score();
  out.palpate_with_the_papers_law = same_law.score();
  out.paper_compared = paper_compared.score(), out.palpate_compared = palpate_compared.score();
  return out;
}

SceneForesight foresight_of(const std::vector<TrialAnswer>& trials) {
  SceneForesight out;
  Moments paper_force, palpate_force, paper_dent, palpate_dent, still;
  for (const TrialAnswer& trial : trials) {
    const auto expected = [&](const UnusedStep& step) { return trial.other_law.empty() ? step.palpate : step.other; };
    const auto forces = [&](const UnusedStep& step) { return std::isfinite(step.paper.force_n) && std::isfinite(expected(step).force_n); };
    const auto dents = [&](const UnusedStep& step) { return std::isfinite(step.paper.dent_m) && std::isfinite(expected(step).dent_m); };
    const auto last = std::find_if(trial.unused.rbegin(), trial.unused.rend(), [&](const UnusedStep& step) { return forces(step) || dents(step); });
    if (last == trial.unused.rend()) continue;
    if (forces(*last)) {
      paper_force.add(100 * (last->paper.force_n / last->force_n - 1));
      palpate_force.add(100 * (expected(*last).force_n / last->force_n - 1));
    }
    if (dents(*last)) {
      paper_dent.add(last->paper.dent_m);
      palpate_dent.add(expected(*last).dent_m);
      still.add(last->dent_still_m);
    }
  }
  const auto foresight = [](const Moments& force, const Moments& dent) {
    return Foresight{std::max(force.count, dent.count), force.mean(), force.rms(), dent.rms()};
  };
  out.paper = foresight(paper_force, paper_dent), out.palpate = foresight(palpate_force, palpate_dent);
  out.still_m = still.rms();
  return out;
}

std::vector<StudyScore> scores_of(std::span<const StudyAnswer> seeds) {
  std::vector<StudyScore> out;
  std::vector<std::pair<Answers, Answers>> answers;  // a row: of the paper's method and of palpate
  for (const StudyAnswer& seed : seeds) {
    for (const StudyRow& row : seed.rows) {
      auto at = std::find_if(out.begin(), out.end(), [&](const StudyScore& one) { return one.what == row.what; });
      const auto k = static_cast<std::size_t>(at - out.begin());
      if (at == out.end()) {
        out.emplace_back().what = row.what;
        answers.emplace_back();
      }
      answers[k].first.add(row, row.paper);
      answers[k].second.add(row, row.palpate);
      for (const std::string& code : std::set<std::string>(row.palpate.verdicts.begin(), row.palpate.verdicts.end())) ++out[k].verdicts[code];
    }
  }
  for (std::size_t k = 0; k < out.size(); ++k) out[k].paper = answers[k].first.score(), out[k].palpate = answers[k].second.score();
  return out;
}

std::vector<Claim> claims_of(const std::vector<SceneAnswers>& scenes) {
  std::vector<double> shares, simulated, solved;
  std::string worse, dear, apart, laws, errors, intervals;  // names of scenes
  int inside = 0, asked = 0;
  for (const SceneAnswers& scene : scenes) {
    if (scene.scene->apparent) continue;
    const SceneScores scores = scores_of(scene.trials);
    inside += scores.palpate.inside_95;
    asked += scores.palpate.asked;
    const std::string name(scene.scene->name);
    const std::string& law = scene.shown().other_law;
    if (!law.empty()) {
      const Score& same = scores.palpate_with_the_papers_law;
      const std::string of_law = fmt::format("palpate with the {} law in {}", law, name);
      laws = also(laws, of_law);
      errors = also(errors, of_law + number(same.rms_percent, " (with the paper's method's law: {:.1f} %)"));
      intervals = also(intervals, of_law + fmt::format(" (with the paper's method's law: {} of {} there)", same.inside_95, same.asked));
    }
    if (scores.apart > 0) apart = also(apart, fmt::format("{} of {} in {}", scores.apart, scores.paper.asked, name));
    // Where the paper's method has no answer nothing is compared: that decides for neither.
    const Score &paper = scores.paper_compared, &palpate = scores.palpate_compared;
    if (paper.answers == 0) continue;
    shares.push_back(palpate.without > 0 ? std::numeric_limits<double>::infinity() : palpate.rms_percent / paper.rms_percent);
    if (!(shares.back() < 1)) worse = also(worse, name);
    // The method after the paper asks a simulator at every (E, nu); what it would solve for with unit responses is not its own.
    if (!(palpate.most_load_cases <= 0.2 * paper.solves)) dear = also(dear, name);
    if (std::isfinite(palpate.solves)) simulated.push_back(palpate.solves / paper.solves);
    if (paper.most_load_cases > 0) solved.push_back(static_cast<double>(palpate.most_load_cases) / paper.most_load_cases);
  }
  if (asked == 0) return {};
  const auto after = [](const std::string& words) { return words.empty() ? "" : "; " + words; };
  const std::string left_out = apart.empty() ? "" : "; left out, for the paper's method has no answer: " + apart;
  const double middle = median(shares), in = 100.0 * inside / asked;
  const bool any = !shares.empty();
  const auto scenes_named = [&](const std::string& names) { return !any ? "nothing to compare" : names.empty() ? std::string("in all") : "not in: " + names; };
  return {{"palpate's rms error of E is smaller in every scene", any && worse.empty(), scenes_named(worse) + after(errors) + left_out},
          {"in the median scene it is at most half", middle <= 0.5,
           (!any                     ? "nothing to compare"
            : std::isfinite(middle) ? fmt::format("{:.2f} of the paper's method's", middle)
                                    : "palpate left out an answer there") +
               after(laws) + left_out},
          {"at least 88 % of the truths lie in palpate's 95 % intervals (no interval: not inside)", in >= 88,
           fmt::format("{:.0f} % of {}", in, asked) + after(intervals)},
          {"palpate's finite elements are solved for at most a fifth as many load cases as the paper's method asks for simulations, "
           "each of which would be one without unit loads",
           any && dear.empty(),
           scenes_named(dear) + fmt::format("; like with like, in the median scene: {} of the simulations asked for, {} of the load "
                                            "cases solved here, where both have unit loads",
                                            number(median(simulated), "{:.2f}"), number(median(solved), "{:.2f}"))}};
}

}  // namespace palpate::cli
