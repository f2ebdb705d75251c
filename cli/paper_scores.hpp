// SPDX-License-Identifier: Apache-2.0
// Errors of both methods over the seeds of a scene, and what the evaluation has to show.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "cli/paper_studies.hpp"
#include "cli/paper_trial.hpp"

namespace palpate::cli {

struct SceneAnswers {
  const lab::PaperScene* scene = nullptr;
  std::vector<TrialAnswer> trials;  ///< one of them has samples and error surface, if any

  /// That one; else the first that is whole.
  const TrialAnswer& shown() const;
};

/// Of a method over the trials of a scene. Trials without an answer count as such and are in no mean.
struct Score {
  int asked = 0, answers = 0, without = 0;
  int with_interval = 0, inside_95 = 0, poisson_inside_95 = 0;  ///< of those asked: without an interval nothing is inside
  double bias_percent = 0, spread_percent = 0, rms_percent = 0;  ///< of log E; NaN: no answer at all
  double median_percent = 0;                                     ///< of its size: a few answers far off are not in it
  int far_off = 0;                                               ///< by more than a factor of ten
  double near_bias_percent = 0, near_rms_percent = 0;            ///< of the others
  double poisson_bias = 0, poisson_spread = 0, poisson_rms = 0;
  /// Over seeds that were answered, all sites together: mean, and median (the clock goes on while a machine does other work).
  double solves = 0, seconds = 0;
  int most_load_cases = 0;         ///< in a seed: later ones take over what does not change
};
/// What a method expects of the highest force of the pushes that no method has seen, over the seeds. NaN: nothing to compare.
struct Foresight {
  int seeds = 0;
  double force_bias_percent = no_value, force_rms_percent = no_value;  ///< of the force at the measured travel, over the true one
  double dent_m = no_value;  ///< root mean square of the dents' rms distances
};
struct SceneForesight {
  Foresight paper, palpate;
  double still_m = no_value;  ///< dents, if nothing is expected to move
};
struct SceneScores {
  Score paper, paper_coarse, palpate;
  /// Of a stuff whose law palpate has and the paper's method has not, `palpate` is that of this law, and this one of the law that both have.
  Score palpate_with_the_papers_law;
  /// The two where the paper's method has an answer: what is compared. `apart` are those where it has none.
  Score paper_compared, palpate_compared;
  int apart = 0;
};
/// Palpate's answer that counts: with the law of the stuff, where it fits that as well.
const MethodAnswer& counted(const TrialAnswer& trial);
/// Of an object with regions, every site's E counts.
SceneScores scores_of(const std::vector<TrialAnswer>& trials);

/// Of seeds in which both methods expect something. Palpate's is that of the answer that counts.
SceneForesight foresight_of(const std::vector<TrialAnswer>& trials);

/// A row of a study over its seeds. Who was not asked is in no number.
struct StudyScore {
  std::string what;
  Score paper, palpate;
  std::map<std::string, int> verdicts;  ///< seeds in which palpate said so
};
/// @param seeds  of one study
std::vector<StudyScore> scores_of(std::span<const StudyAnswer> seeds);

/// A line of what the evaluation has to show.
struct Claim {
  std::string what;
  bool holds = false;
  std::string found;
};
/// Scenes whose object has no E to compare with are left out. Empty: there is no other.
std::vector<Claim> claims_of(const std::vector<SceneAnswers>& scenes);

}  // namespace palpate::cli
