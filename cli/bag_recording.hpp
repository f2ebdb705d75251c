// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/session.hpp"
#include "palpate/load_recording.hpp"

namespace palpate::cli {

/// What a verb is given as its recording, checked. Says the offsets of a bag's clocks; its warnings are the verb's to say. @throws Error; also for
/// what check_recording finds.
/// @param clocks  if given, the offsets that were estimated between a bag's clocks
Recording load_recording(Session& session, const std::filesystem::path& path, const std::filesystem::path& mapping,
                         std::vector<acquisition::ClockOffset>* clocks = nullptr);

/// The same, unchecked.
Recording load_recording_unchecked(Session& session, const std::filesystem::path& path,
                                   const std::filesystem::path& mapping,
                                   std::vector<acquisition::ClockOffset>* clocks = nullptr);

/// @throws Error where nothing is, or where no recording can be; names what is called nearly so beside it
LoadedRecording load_existing(const std::filesystem::path& path, const std::filesystem::path& mapping);

/// "+45.9 +- 52.2 ms against the arm's (correlation 0.61), nothing taken off", for people and provenance.
std::string to_words(const acquisition::ClockOffset& clock);

}  // namespace palpate::cli
