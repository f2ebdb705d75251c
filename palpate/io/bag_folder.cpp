// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag_folder.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "palpate/io/file.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/ros_messages.hpp"
#include "palpate/io/yaml_text.hpp"

namespace palpate::io {

void BagFolder::put(const std::string& topic, const std::string& type, std::int64_t time_ns, std::string_view data) {
  auto place = topics_.find(topic);
  if (place == topics_.end())
    place = topics_.emplace(topic, Topic{mcap_.add_channel(topic, type, ros_type(type).definition), type, 0}).first;
  mcap_.add_message(place->second.channel, static_cast<std::uint64_t>(time_ns), data);
  ++place->second.messages;
  first_ns_ = std::min(first_ns_, time_ns);
  last_ns_ = std::max(last_ns_, time_ns);
}

void BagFolder::put_all(const std::filesystem::path& folder) {
  const MessageSource bag = read_bag(folder);
  for (const Message& message : bag.messages)
    put(bag.topics[message.topic].name, bag.topics[message.topic].type, message.log_time_ns, message.data);
}

void BagFolder::write(const std::filesystem::path& folder) const {
  const std::string file = folder.filename().string() + "_0.mcap";
  McapWriter whole = mcap_;  // more may be put into ours
  write_file(folder / file, whole.finish());
  write_file(folder / "metadata.yaml", metadata_text(file));
}

/// Version 5 is the lowest that says of each file what it holds; rosbag2 refuses metadata that lacks a key of its version
/// (rosbag2_storage/yaml.hpp).
std::string BagFolder::metadata_text(const std::string& file) const {
  std::uint64_t total = 0;
  std::string topics;
  for (const auto& [name, topic] : topics_) {
    total += topic.messages;
    topics += fmt::format(
        "    - topic_metadata:\n        name: {}\n        type: {}\n        serialization_format: cdr\n"
        "        offered_qos_profiles: \"\"\n      message_count: {}\n",
        name, topic.type, topic.messages);
  }
  const std::int64_t start_ns = total > 0 ? first_ns_ : 0, duration_ns = total > 0 ? last_ns_ - first_ns_ : 0;
  return fmt::format(
      "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    nanoseconds: {0}\n"
      "  starting_time:\n    nanoseconds_since_epoch: {1}\n  message_count: {2}\n  topics_with_message_count:{3}{4}"
      "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - {5}\n"
      "  files:\n    - path: {5}\n      starting_time:\n        nanoseconds_since_epoch: {1}\n"
      "      duration:\n        nanoseconds: {0}\n      message_count: {2}\n",
      duration_ns, start_ns, total, topics.empty() ? " []\n" : "\n", topics, yaml_word(file));
}

}  // namespace palpate::io
