// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/repeated_notes.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::acquisition {

std::string seconds_text(double value) {
  const std::string text = std::to_string(value);
  return text.substr(0, text.find('.') + 4) + " s";
}

void RepeatedNotes::add(const std::string& head, double time_s, const std::string& tail, double gap_s) {
  const auto same = [&](const Note& one) { return one.head == head && one.tail == tail; };
  const auto note = std::find_if(notes_.begin(), notes_.end(), same);
  if (note == notes_.end()) {
    notes_.push_back({head, tail, time_s, time_s, gap_s, 1});
    return;
  }
  ++note->steps;
  if (gap_s > note->gap_s) note->gap_s = gap_s, note->furthest_s = time_s;
}

std::vector<std::string> RepeatedNotes::texts() const {
  std::vector<std::string> all;
  for (const Note& one : notes_) {
    std::string text = one.head + " ";
    const bool has_gap = one.gap_s > 0 && std::isfinite(one.gap_s);
    if (one.steps == 1)
      text += "the step at " + seconds_text(one.first_s) + (has_gap ? "; the nearest is " + seconds_text(one.gap_s) + " away" : "");
    else
      text += std::to_string(one.steps) + " steps, the first at " + seconds_text(one.first_s) +
              (has_gap ? "; at " + seconds_text(one.furthest_s) + " the nearest is furthest, " + seconds_text(one.gap_s) + " away" : "");
    all.push_back(text + one.tail);
  }
  return all;
}

}  // namespace palpate::acquisition
