// SPDX-License-Identifier: Apache-2.0
// The way in from files: a recording in a folder, or a bag of ROS 1 or 2 with its mapping.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "palpate/acquisition/clock_offset.hpp"
#include "palpate/core/recording.hpp"

namespace palpate {

struct LoadedRecording {
  Recording recording;                           ///< its warnings also say what was left out of a bag
  std::vector<acquisition::ClockOffset> clocks;  ///< of a bag: the offsets that were estimated between its clocks
};

/// Not checked yet: `check_loaded` is next.
/// @param path     a folder with recording.yaml in it, or a bag: MCAP, rosbag2 (a folder or .db3), ROS 1
/// @param mapping  what a bag's topics mean (docs/recording-format.md); empty: mapping.yaml in its folder or beside it
/// @throws Error naming file, line and field, and the cure
LoadedRecording load_recording(const std::filesystem::path& path, const std::filesystem::path& mapping = {});

/// Adds to its warnings what is odd (`warn_of_oddities`). @throws Error for the first of what io::check_recording finds
/// @param lister  that lists all of it, for the message
void check_loaded(Recording& recording, const std::string& lister = "`palpate info`");

/// The mapping that belongs to a bag when none is given: mapping.yaml in its folder, or beside the file. Empty: there is none.
std::filesystem::path mapping_of(const std::filesystem::path& bag);

}  // namespace palpate
