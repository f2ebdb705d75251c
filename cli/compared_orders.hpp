// SPDX-License-Identifier: Apache-2.0
// Orders of pushes over several labs (`explore --compare --seeds N`): what is in the middle, where some did not come to the goal.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace palpate::cli {

struct OrderedRun {
  bool reached = false;
  int pushes = 0;  ///< not reached: the goal takes more
};

/// "5 pushes in the middle of 7 labs (4 to more than 12)"; of an even number of labs the larger of the two in the middle.
std::string middle_words(std::vector<OrderedRun> runs);

nlohmann::json by_seed_json(const std::string& order, const std::vector<OrderedRun>& runs);

}  // namespace palpate::cli
