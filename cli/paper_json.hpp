// SPDX-License-Identifier: Apache-2.0
// The numbers of `palpate paper` for paper.json.
#pragma once

#include <nlohmann/json.hpp>

#include "cli/paper_scores.hpp"
#include "cli/paper_studies.hpp"

namespace palpate::cli {

nlohmann::json json_of(const SceneAnswers& answers);
nlohmann::json json_of(const StudyAnswer& answer);

}  // namespace palpate::cli
