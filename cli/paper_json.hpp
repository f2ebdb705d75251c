// SPDX-License-Identifier: Apache-2.0
// The numbers of `palpate paper` for paper.json.
#pragma once

#include <nlohmann/json.hpp>
#include <span>

#include "cli/paper_scores.hpp"
#include "cli/paper_studies.hpp"

namespace palpate::cli {

nlohmann::json json_of(const SceneAnswers& answers);
nlohmann::json json_of(const StudyAnswer& answer);
/// Over the seeds of each study. @param sorted  those of one study together
nlohmann::json json_of(std::span<const StudyAnswer> sorted);

}  // namespace palpate::cli
