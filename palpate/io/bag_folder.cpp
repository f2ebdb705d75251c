// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag_folder.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "palpate/io/file.hpp"
#include "palpate/io/ros_messages.hpp"
#include "palpate/io/yaml_text.hpp"

namespace palpate::io {
namespace {

/// What a player is to offer, as rosbag2 writes it before version 9 (rmw/types.h: history 3 unknown, reliability 1 reliable,
/// durability 1 transient local, 2 volatile, liveliness 1 automatic). What is said once is kept for those who listen later.
std::string offered_qos(const std::string& topic) {
  const bool kept = topic == "/tf_static" || topic == "/robot_description";
  constexpr const char* forever = "    sec: 9223372036\n    nsec: 854775807\n";
  return fmt::format(
      "- history: 3\n  depth: 0\n  reliability: 1\n  durability: {0}\n  deadline:\n{1}  lifespan:\n{1}  liveliness: 1\n"
      "  liveliness_lease_duration:\n{1}  avoid_ros_namespace_conventions: false",
      kept ? 1 : 2, forever);
}

/// In double quotes.
std::string on_one_line(const std::string& text) {
  std::string out = "\"";
  for (const char one : text) out += one == '\n' ? std::string("\\n") : std::string(1, one);
  return out + '"';
}

/// The same lines, two blanks further to the right.
std::string indented(const std::string& text) {
  std::string out;
  bool begins = true;
  for (const char one : text) {
    if (begins) out += "  ";
    out += one;
    begins = one == '\n';
  }
  return out;
}

}  // namespace

void BagFolder::put(const std::string& topic, const std::string& type, std::int64_t time_ns, std::string_view data) {
  auto place = topics_.find(topic);
  if (place == topics_.end())
    place = topics_
                .emplace(topic, Topic{mcap_.add_channel(topic, type, ros_type(type).definition, "ros2msg", "cdr",
                                                        {{"offered_qos_profiles", offered_qos(topic)}}),
                                      type, 0})
                .first;
  mcap_.add_message(place->second.channel, static_cast<std::uint64_t>(time_ns), data);
  ++place->second.messages;
  first_ns_ = std::min(first_ns_, time_ns);
  last_ns_ = std::max(last_ns_, time_ns);
}

void BagFolder::put_all(const MessageSource& bag, const std::string& but) {
  for (const Message& message : bag.messages)
    if (bag.topics[message.topic].name != but) put(bag.topics[message.topic].name, bag.topics[message.topic].type, message.log_time_ns, message.data);
}

void BagFolder::write(const std::filesystem::path& folder) const {
  const std::string file = folder.filename().string() + "_0.mcap";
  const std::string about = metadata_text(file);
  McapWriter whole = mcap_;  // more may be put into ours
  // A player that is given the file alone takes the offers in it for those of its own version unless this says of which they are.
  whole.add_metadata("rosbag2", {{"serialized_metadata", about}});
  write_file(folder / file, whole.finish());
  write_file(folder / "metadata.yaml", "rosbag2_bagfile_information:\n" + indented(about));
}

/// Version 5 is the lowest that says of each file what it holds; rosbag2 refuses metadata that lacks a key of its version
/// (rosbag2_storage/yaml.hpp).
std::string BagFolder::metadata_text(const std::string& file) const {
  std::uint64_t total = 0;
  std::string topics;
  for (const auto& [name, topic] : topics_) {
    total += topic.messages;
    topics += fmt::format(
        "  - topic_metadata:\n      name: {}\n      type: {}\n      serialization_format: cdr\n"
        "      offered_qos_profiles: {}\n    message_count: {}\n",
        name, topic.type, on_one_line(offered_qos(name)), topic.messages);
  }
  const std::int64_t start_ns = total > 0 ? first_ns_ : 0, duration_ns = total > 0 ? last_ns_ - first_ns_ : 0;
  return fmt::format(
      "version: 5\nstorage_identifier: mcap\nduration:\n  nanoseconds: {0}\n"
      "starting_time:\n  nanoseconds_since_epoch: {1}\nmessage_count: {2}\ntopics_with_message_count:{3}{4}"
      "compression_format: \"\"\ncompression_mode: \"\"\nrelative_file_paths:\n  - {5}\n"
      "files:\n  - path: {5}\n    starting_time:\n      nanoseconds_since_epoch: {1}\n"
      "    duration:\n      nanoseconds: {0}\n    message_count: {2}\n",
      duration_ns, start_ns, total, topics.empty() ? " []\n" : "\n", topics, yaml_word(file));
}

}  // namespace palpate::io
