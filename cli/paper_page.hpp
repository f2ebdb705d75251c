// SPDX-License-Identifier: Apache-2.0
// The page of `palpate paper`: the paper's figures remade, and a table paper / its method here / palpate.
#pragma once

#include <string>
#include <vector>

#include "cli/paper_trial.hpp"

namespace palpate::cli {

struct SceneAnswers {
  const lab::PaperScene* scene = nullptr;
  std::vector<TrialAnswer> trials;  ///< the first one has samples and error surface
};

/// Of a method over the trials of a scene.
struct Score {
  int answers = 0, with_interval = 0, inside_95 = 0;
  double bias_percent = 0, rms_percent = 0;  ///< of log E
  double poisson_bias = 0, poisson_rms = 0;
  double solves = 0, seconds = 0;            ///< means
};
struct SceneScores {
  Score paper, paper_coarse, palpate;
};
/// Of an object with regions, every site's E counts.
SceneScores scores_of(const std::vector<TrialAnswer>& trials);

/// One offline HTML file.
std::string paper_page(const std::vector<SceneAnswers>& scenes, const std::string& command, int threads);

}  // namespace palpate::cli
