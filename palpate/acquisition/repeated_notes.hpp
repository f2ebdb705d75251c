// SPDX-License-Identifier: Apache-2.0
// What would be said of step after step, said once. Inner header of the room `acquisition`.
#pragma once

#include <string>
#include <vector>

namespace palpate::acquisition {

class RepeatedNotes {
 public:
  /// Reads "HEAD the step at 1.000 s TAIL", of several "HEAD 3 steps, the first at 1.000 s TAIL". One with another head or
  /// tail is another note.
  /// @param gap_s  how far off what was sought is; the furthest is named. Infinite: there is none at all.
  void add(const std::string& head, double time_s, const std::string& tail = {}, double gap_s = 0);
  /// In the order in which they were first said.
  std::vector<std::string> texts() const;

 private:
  struct Note {
    std::string head, tail;
    double first_s, furthest_s, gap_s;
    std::size_t steps;
  };
  std::vector<Note> notes_;
};

/// "1.250 s"
std::string seconds_text(double value);

}  // namespace palpate::acquisition
