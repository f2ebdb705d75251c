// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/session.hpp"
#include "palpate/acquisition/clock_offset.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::cli {

/// A folder with recording.yaml, or a bag with a mapping (given, or mapping.yaml in the bag's folder).
struct LoadedRecording {
  Recording recording;                           ///< its warnings also say what was left out of a bag
  std::vector<acquisition::ClockOffset> clocks;  ///< of a bag
};

/// Says nothing, and does not check. @throws Error
LoadedRecording load_recording(const std::filesystem::path& path, const std::filesystem::path& mapping);

/// What can be, but seldom is meant, as warnings of the recording: odd numbers, a robot's part that cannot be masked.
void warn_of_oddities(Recording& recording);

/// Adds to its warnings what is odd. @throws Error for the first of what check_recording finds
/// @param lister  that lists all of it, for the message
void check_loaded(Recording& recording, const std::string& lister = "`palpate info`");

/// What a verb is given as its recording, checked. Says the offsets of a bag's clocks; its warnings are the verb's to say. @throws Error; also for
/// what check_recording finds.
/// @param clocks  if given, the offsets that were estimated between a bag's clocks
Recording load_recording(Session& session, const std::filesystem::path& path, const std::filesystem::path& mapping,
                         std::vector<acquisition::ClockOffset>* clocks = nullptr);

/// The same, unchecked.
Recording load_recording_unchecked(Session& session, const std::filesystem::path& path,
                                   const std::filesystem::path& mapping,
                                   std::vector<acquisition::ClockOffset>* clocks = nullptr);

/// "+45.9 +- 52.2 ms against the arm's (correlation 0.61), nothing taken off", for people and provenance.
std::string to_words(const acquisition::ClockOffset& clock);

/// The mapping that belongs to a bag when none is given: mapping.yaml in its folder, or beside the file. Empty = none.
std::filesystem::path mapping_of(const std::filesystem::path& bag);

}  // namespace palpate::cli
