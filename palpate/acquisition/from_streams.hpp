// SPDX-License-Identifier: Apache-2.0
// A recording out of streams that somebody else's recorder kept: the steps that our own protocol would have recorded are
// found in them.
#pragma once

#include <string>
#include <vector>

#include "palpate/acquisition/clock_offset.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/core/streams.hpp"

namespace palpate::acquisition {

struct FromStreams {
  Recording recording;
  std::vector<ClockOffset> clocks;  ///< those that were estimated
  std::vector<std::string> notes;   ///< what was found and what was left out, in plain words
};

/// @throws Error when no recording can come of it: frames that are not connected, no contact where one has to be found, no
///         step.
FromStreams recording_from(const StreamPlan& plan, const SensorStreams& streams);

}  // namespace palpate::acquisition
