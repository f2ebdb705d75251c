// SPDX-License-Identifier: Apache-2.0
// The page of `palpate paper`: the paper's figures remade, and a table paper / its method here / palpate.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "cli/paper_scores.hpp"
#include "cli/paper_studies.hpp"

namespace palpate::cli {

/// One offline HTML file.
/// @param version     of the program that made the answers
/// @param details_of  the seed of which studies show their rows; where there is none, their first
/// @param coarse      all are of --quick
std::string paper_page(const std::vector<SceneAnswers>& scenes, const std::vector<StudyAnswer>& studies, const std::string& version,
                       const std::string& command, const std::set<int>& threads, std::uint64_t details_of = 1, bool coarse = false);

}  // namespace palpate::cli
