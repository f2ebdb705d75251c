// SPDX-License-Identifier: Apache-2.0
// A recording that went through files: written by the product's own writers and read again, as a folder or as a bag.
#pragma once

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "palpate/acquisition/from_streams.hpp"
#include "palpate/io/bag_mapping.hpp"
#include "palpate/io/bag_write.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/recording.hpp"
#include "temporary_folder.hpp"

namespace palpate::io::test {

/// What a bag with its mapping says, read as the program reads it; nothing in it may be left out or doubted.
inline Recording read_back(const std::filesystem::path& folder) {
  BagMapping mapping = read_mapping(folder / "mapping.yaml");
  const SensorStreams streams = read_streams(read_bag(folder), mapping);
  const acquisition::FromStreams made = acquisition::recording_from(mapping.plan, streams);
  EXPECT_TRUE(made.notes.empty()) << made.notes.front();
  EXPECT_TRUE(made.recording.warnings.empty()) << made.recording.warnings.front();
  return made.recording;
}

/// @param way  memory: as it is; folder; mcap: a bag of rosbag2
inline Recording through(const std::string& way, const Recording& recording) {
  if (way == "memory") return recording;
  const palpate::test::TemporaryFolder folder("through_" + way);
  if (way == "folder") {
    write_recording(recording, folder / "recording");
    return read_recording_unchecked(folder / "recording");
  }
  if (way != "mcap")
    throw std::invalid_argument("a recording goes through memory, folder or mcap, not through '" + way + "'");
  write_bag(recording, folder / "bag");
  return read_back(folder / "bag");
}

}  // namespace palpate::io::test
