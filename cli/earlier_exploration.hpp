// SPDX-License-Identifier: Apache-2.0
// What `explore --resume` goes on from.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::cli {

struct EarlierExploration {
  Recording recording;             ///< with the pushes that count, whole or cut off under load
  std::vector<std::string> words;  ///< what is said of the last one, where it was cut off
};

/// @param out  of a run of explore, with `recording` in it  @param now  what stands before the robot, without pushes
/// @param views  the shape was looked at from so many sides, then and now; 0: it is given
/// @throws Error where there is no recording, or one of something else
EarlierExploration earlier_exploration(const std::filesystem::path& out, const Recording& now, int views);

}  // namespace palpate::cli
