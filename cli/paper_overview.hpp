// SPDX-License-Identifier: Apache-2.0
// Every scene of `palpate paper` in a row, and every seed of a scene in one, as HTML.
#pragma once

#include <string>
#include <vector>

#include "cli/paper_scores.hpp"

namespace palpate::cli {

/// What the paper reports, what its method finds here, what palpate finds.
std::string overview_table(const std::vector<SceneAnswers>& scenes);
/// Truth, answers and seconds, folded away.
std::string seed_table(const SceneAnswers& answers);

}  // namespace palpate::cli
