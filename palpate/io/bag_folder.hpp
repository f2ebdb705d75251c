// SPDX-License-Identifier: Apache-2.0
// What both of our bags are: a folder of rosbag2 with one MCAP file and metadata.yaml.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <string>
#include <string_view>

#include "palpate/io/mcap.hpp"
#include "palpate/io/message_source.hpp"

namespace palpate::io {

class BagFolder {
 public:
  /// @param type  one of ros_types()
  void put(const std::string& topic, const std::string& type, std::int64_t time_ns, std::string_view data);
  bool has(const std::string& topic) const { return topics_.contains(topic); }
  /// Puts everything that a bag of an earlier run holds, but for one topic.
  void put_all(const MessageSource& bag, const std::string& but);
  /// Earliest and latest time so far; 0 without a message.
  std::int64_t first_ns() const { return topics_.empty() ? 0 : first_ns_; }
  std::int64_t last_ns() const { return last_ns_; }
  std::size_t size_bytes() const { return mcap_.size_bytes(); }
  /// Writes NAME_0.mcap and metadata.yaml into the folder NAME, which is there: a whole bag of what has been put so far.
  void write(const std::filesystem::path& folder) const;

 private:
  struct Topic {
    std::uint16_t channel = 0;
    std::string type;
    std::uint64_t messages = 0;
  };
  std::string metadata_text(const std::string& file) const;

  McapWriter mcap_;
  std::map<std::string, Topic> topics_;
  std::int64_t first_ns_ = std::numeric_limits<std::int64_t>::max(), last_ns_ = 0;
};

}  // namespace palpate::io
