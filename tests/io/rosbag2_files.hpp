// SPDX-License-Identifier: Apache-2.0
// A folder of rosbag2 as each of its versions writes it: metadata.yaml after encode() of rosbag2_storage/yaml.hpp (up to version
// 3 of metadata_io.cpp), packed files and messages after rosbag2_compression.
#pragma once

#include <zstd.h>

#include <map>
#include <string>
#include <vector>

#include "io/bag_files.hpp"
#include "io/recording_folder.hpp"

namespace palpate::io::test {

inline std::string packed(const std::string& bytes) {
  std::string out(ZSTD_compressBound(bytes.size()), '\0');
  out.resize(ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 3));
  return out;
}

struct Rosbag2Form {
  int version = 9;               ///< of metadata.yaml, 1 to 9
  std::string storage = "mcap";  ///< or sqlite3
  std::string mode;              ///< of compression: empty, FILE or MESSAGE
};

/// @param files  relative_file_paths, as they stand in the file
inline std::string rosbag2_metadata_text(const Rosbag2Form& form, const std::vector<TestMessage>& messages,
                                         const std::vector<std::string>& files) {
  const std::string time = std::to_string(messages.front().time_ns), count = std::to_string(messages.size());
  std::map<std::string, std::pair<std::string, std::size_t>> topics;
  for (const TestMessage& one : messages) topics[one.topic].first = one.type, ++topics[one.topic].second;
  std::string text = "rosbag2_bagfile_information:\n  version: " + std::to_string(form.version) +
                     "\n  storage_identifier: " + form.storage +
                     "\n  duration:\n    nanoseconds: 5\n  starting_time:\n    nanoseconds_since_epoch: " + time +
                     "\n  message_count: " + count + "\n  topics_with_message_count:\n";
  for (const auto& [name, topic] : topics) {
    text += "    - topic_metadata:\n        name: " + name + "\n        type: " + topic.first +
            "\n        serialization_format: cdr\n";
    if (form.version >= 9)
      text += "        offered_qos_profiles:\n          - history: keep_last\n            depth: 10\n            deadline:\n"
              "              sec: 9223372036\n              nsec: 854775807\n";
    else if (form.version >= 4)
      text += "        offered_qos_profiles: \"- history: 1\\n  depth: 10\\n  deadline:\\n    sec: 9223372036\"\n";
    if (form.version >= 7) text += "        type_description_hash: RIHS01_0\n";
    text += "      message_count: " + std::to_string(topic.second) + "\n";
  }
  if (form.version >= 3)
    text += form.mode.empty() ? "  compression_format: \"\"\n  compression_mode: \"\"\n"
                              : "  compression_format: zstd\n  compression_mode: " + form.mode + "\n";
  text += "  relative_file_paths:\n";
  for (const std::string& file : files) text += "    - " + file + "\n";
  if (form.version >= 5) {
    text += "  files:\n";
    for (const std::string& file : files)
      text += "    - path: " + file + "\n      starting_time:\n        nanoseconds_since_epoch: " + time +
              "\n      duration:\n        nanoseconds: 5\n      message_count: " + count + "\n";
  }
  if (form.version >= 6) text += "  custom_data: ~\n";
  if (form.version >= 8) text += "  ros_distro: rolling\n";
  return text;
}

/// Puts the bag's one file into `folder` and gives its name.
inline std::string put_rosbag2_file(const TemporaryFolder& folder, const Rosbag2Form& form, std::vector<TestMessage> messages) {
  if (form.mode == "MESSAGE" || form.mode == "message")
    for (TestMessage& one : messages) one.data = packed(one.data);
  const int schema = form.version <= 2 ? 1 : form.version <= 4 ? 2 : form.version == 5 ? 3 : 4;
  std::string bytes = form.storage == "mcap" ? mcap_bytes(messages, McapWriter::Compression::none) : sqlite_bytes(messages, schema);
  std::string name = form.storage == "mcap" ? "bag_0.mcap" : "bag_0.db3";
  if (form.mode == "FILE" || form.mode == "file") bytes = packed(bytes), name += ".zstd";
  folder.put(name, bytes);
  return name;
}

}  // namespace palpate::io::test
