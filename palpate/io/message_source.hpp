// SPDX-License-Identifier: Apache-2.0
// The messages of a bag, whatever container they came in. A container is one function and one line in the table of
// message_source.cpp; the contract test loops over it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::io {

/// How the bytes of a message are laid out.
enum class MessageEncoding { cdr, ros1, other };

struct MessageTopic {
  std::string name;  ///< "/camera/depth"
  std::string type;  ///< as ROS 2 writes it: "sensor_msgs/msg/Image"
  MessageEncoding encoding = MessageEncoding::cdr;
  std::size_t messages = 0;
};

struct Message {
  std::size_t topic = 0;         ///< in MessageSource::topics
  std::int64_t log_time_ns = 0;  ///< when it was recorded
  std::string_view data;         ///< valid as long as the MessageSource, or a copy of it, lives
};

/// A bag is read as a whole: it has to fit into memory.
struct MessageSource {
  std::string name;                    ///< path, for messages
  std::string format;                  ///< row of bag_formats()
  std::vector<MessageTopic> topics;    ///< in the order of their names
  std::vector<Message> messages;       ///< in the order of log time, equal times as they stand in the file
  std::vector<std::string> warnings;   ///< what was lost, in plain words
  std::shared_ptr<const void> memory;  ///< what `data` points into
};

struct BagFormat {
  std::string name;
  std::vector<std::string> extensions;  ///< lower case with the dot
  std::string about;
  std::string_view magic;  ///< first bytes of every such file
  /// What a file that was cut off still holds is given, with a warning. @throws Error when it is no such file at all.
  MessageSource (*parse)(std::string bytes, const std::string& name) = nullptr;
};

std::span<const BagFormat> bag_formats();

/// True for a file or a folder that read_bag would take: told by the file's first bytes, or by the folder's metadata.yaml or
/// bag files, never by a recording.yaml.
bool is_bag(const std::filesystem::path& path);

/// A file, or a folder of rosbag2 (metadata.yaml and the files that it names; without it, all bag files in the folder).
/// @throws Error when there is no such file or it is no bag.
MessageSource read_bag(const std::filesystem::path& path);
MessageSource parse_bag(std::string bytes, const std::string& name);

/// "sensor_msgs/Image" of ROS 1 becomes "sensor_msgs/msg/Image".
std::string ros2_type_name(const std::string& type);

/// Collects what a container holds; topics of one name, type and encoding become one.
class MessageCollector {
 public:
  /// Index to give with the messages of this topic.
  std::size_t topic(const std::string& name, const std::string& type, MessageEncoding encoding);
  void add(std::size_t topic, std::int64_t log_time_ns, std::string_view data) {
    messages_.push_back({topic, log_time_ns, data});
  }
  std::vector<std::string> warnings;
  /// Sorted, counted, with the memory that the data points into.
  MessageSource finish(std::shared_ptr<const void> memory, const std::string& name);

 private:
  std::vector<MessageTopic> topics_;
  std::vector<Message> messages_;
};

}  // namespace palpate::io
