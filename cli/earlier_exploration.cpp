// SPDX-License-Identifier: Apache-2.0
#include "cli/earlier_exploration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "cli/resumed_recording.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::cli {

EarlierExploration earlier_exploration(const std::filesystem::path& out, const Recording& now, int views) {
  const std::filesystem::path folder = out / "recording";
  std::error_code code;
  if (!std::filesystem::exists(folder / "recording.yaml", code))
    throw Error("cannot go on: it holds no `recording` of `palpate explore`; choose the folder that it was begun in, or an empty one",
                out.string());
  EarlierExploration earlier;
  Recording& recording = earlier.recording;
  recording = io::read_recording_unchecked(folder);
  must_be_same_scene(recording, now, views > 0 && views == int(recording.rest.views.size()), folder);
  if (recording.pushes.empty()) return earlier;
  const Push& last = recording.pushes.back();
  const auto loaded = std::count_if(last.steps.begin(), last.steps.end(), [](const Step& step) { return !step.loads.empty(); });
  if (loaded == 0) {
    earlier.words.push_back(fmt::format("{} was cut off before it pressed: it does not count, and a push is chosen anew", last.name));
    recording.pushes.pop_back();
  } else if (!last.steps.back().unloading || !last.steps.back().loads.empty()) {
    earlier.words.push_back(fmt::format("{} was cut off: its {} step{} under load count. The look after it is missing, so nobody knows how "
                                        "far the force's zero moved in it, or whether the object came back",
                                        last.name, loaded, loaded == 1 ? "" : "s"));
  }
  return earlier;
}

}  // namespace palpate::cli
