// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/repeated_notes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace palpate::acquisition::repeated_notes_test {
namespace {

TEST(RepeatedNotes, AreSaidOnceWithTheirCountAndTheWorst) {
  RepeatedNotes notes;
  for (const auto& [time_s, gap_s] : {std::pair(3.0, 0.75), {8.0, 1.5}, {9.0, 1.25}})
    notes.add("/depth: no image within 0.500 s of", time_s, "", gap_s);
  notes.add("/depth: the image cannot be used of", 4, ": is damaged");
  notes.add("/depth: the image cannot be used of", 5, ": is too short");
  notes.add("/depth: the image cannot be used of", 6, ": is damaged");
  notes.add("/other: no image within 0.500 s of", 7, "", 0.625);
  for (const double time_s : {1.0, 2.0}) notes.add("/none: no image within 0.500 s of", time_s, "", std::numeric_limits<double>::infinity());
  EXPECT_THAT(notes.texts(),
              testing::ElementsAre("/depth: no image within 0.500 s of 3 steps, the first at 3.000 s; at 8.000 s the nearest is "
                                   "furthest, 1.500 s away",
                                   "/depth: the image cannot be used of 2 steps, the first at 4.000 s: is damaged",
                                   "/depth: the image cannot be used of the step at 5.000 s: is too short",
                                   "/other: no image within 0.500 s of the step at 7.000 s; the nearest is 0.625 s away",
                                   "/none: no image within 0.500 s of 2 steps, the first at 1.000 s"));
}

}  // namespace
}  // namespace palpate::acquisition::repeated_notes_test
