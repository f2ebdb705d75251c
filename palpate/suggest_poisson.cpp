// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/identify.hpp"
#include "palpate/suggest.hpp"

namespace palpate {
namespace {

constexpr double quantile_975 = 1.959963984540054;

/// Every fit that cannot tell nu pays for this: a second on the 4800 nodes of the lab's bar, where what `palpate suggest` compares
/// (twice as many places, two tilts) takes five and promises 0.010 instead of 0.014 to 0.018. Larger meshes get fewer places.
estimation::CandidateOptions few_candidates(Index nodes) {
  constexpr double nodes_of_most = 5000;
  constexpr int most = 12, least = 6;
  estimation::CandidateOptions options;
  options.contacts = std::clamp(static_cast<int>(most * nodes_of_most / static_cast<double>(nodes)), least, most);
  options.tilts = 1;
  return options;
}

std::string words_of(const estimation::PushRanking& ranking, const PushScene& scene, const Parameter& poisson,
                     const ModelDefaults& model) {
  const estimation::RatedPush& best = ranking.pushes.front();
  const double half = quantile_975 * best.expected.poisson_std;
  const double lower = std::max(model.poisson_lower, poisson.value - half), upper = std::min(model.poisson_upper, poisson.value + half);
  // As the fit calls it determined.
  const bool enough = best.expected.poisson_std < 0.6 * (model.poisson_upper - model.poisson_lower) / std::sqrt(12.0);
  const std::string promise = fmt::format("nu would then be known within {:.2g} (95 %): [{:.3f}, {:.3f}] if it is {:.3f}", half,
                                          lower, upper, poisson.value);
  if (!enough)
    return fmt::format(" No single push of {} that were compared determines it; the best is a {}, and {}. Give more views, or take "
                       "nu as known.",
                       scene.candidates.size(), push_words(best, scene), promise);
  return fmt::format(" Of {} that were compared the best next one is a {}: there nu changes what is seen the most in a way that "
                     "E, contact and pose cannot; {}.",
                     scene.candidates.size(), push_words(best, scene), promise);
}

}  // namespace

void name_push_for_poisson(const Recording& recording, Identified& found, int threads, const OnProgress& progress) {
  Identification& answer = found.answer;
  const auto verdict = std::find_if(answer.verdicts.begin(), answer.verdicts.end(),
                                    [](const Verdict& each) { return each.code == "nu_not_determined"; });
  const auto poisson = std::find_if(answer.parameters.begin(), answer.parameters.end(),
                                    [](const Parameter& each) { return each.name == "poisson_ratio"; });
  const bool usable = answer.termination == Termination::converged && answer.covariance.size() > 0;
  if (verdict == answer.verdicts.end() || poisson == answer.parameters.end() || !usable) return;
  if (!poisson->region.empty()) return;  // pushes are planned for a nu that all regions share
  if (!why_not_to_build_on(answer).empty()) return;
  SuggestOptions options;
  options.goal = estimation::PushGoal::poisson_ratio;
  options.candidates = few_candidates(found.volume.nodes_m.rows());
  options.threads = threads;
  try {
    const PushScene scene = prepare_pushes(as_fitted(found.object, recording), options, progress);
    const estimation::PushRanking ranking = suggest(scene, &answer, options, progress);
    if (!ranking.pushes.empty()) verdict->message += words_of(ranking, scene, *poisson, found.object.model);
  } catch (const Error&) {  // no push can be planned here; the answer stands without
  }
}

}  // namespace palpate
