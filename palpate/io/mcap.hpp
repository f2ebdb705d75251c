// SPDX-License-Identifier: Apache-2.0
// MCAP, rosbag2's default container (mcap.dev/spec): records in chunks, each chunk perhaps compressed.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::io {

struct McapChannel {
  std::uint16_t id = 0;
  std::string topic;
  std::string message_encoding;  ///< "cdr" for ROS 2
  std::string schema_name;       ///< "sensor_msgs/msg/Image"
  std::string schema_encoding;   ///< "ros2msg"
};

struct McapMessage {
  std::uint16_t channel = 0;
  std::uint64_t log_time_ns = 0, publish_time_ns = 0;
  std::string_view data;  ///< into the McapFile that holds it
};

/// Everything in a file. Messages are in the order of their log time, equal times in file order.
class McapFile {
 public:
  /// Reads front to back and needs no index, so that a file that was cut off while it was recorded still gives what was
  /// written; `warnings` says what was lost. Throws Error when it is no MCAP file at all.
  static McapFile parse(std::string bytes, const std::string& name);

  std::string profile, written_by;
  std::map<std::uint16_t, McapChannel> channels;
  std::vector<McapMessage> messages;
  std::vector<std::string> warnings;

 private:
  std::deque<std::string> storage_;  ///< the file and the unpacked chunks that messages point into; addresses stay
  friend class McapParser;
};

/// Writes chunks with indices and a summary, so that viewers can jump in time.
class McapWriter {
 public:
  enum class Compression { none, zstd };
  explicit McapWriter(std::string profile = "ros2", Compression compression = Compression::zstd);
  using Notes = std::map<std::string, std::string>;
  /// @param notes  what the format calls the channel's metadata
  std::uint16_t add_channel(const std::string& topic, const std::string& schema_name, const std::string& schema_text,
                            const std::string& schema_encoding = "ros2msg", const std::string& message_encoding = "cdr",
                            const Notes& notes = {});
  /// A record of metadata about the whole file.
  void add_metadata(const std::string& name, const Notes& notes);
  /// Times need not come in order.
  void add_message(std::uint16_t channel, std::uint64_t time_ns, std::string_view data);
  /// Of what was added so far, as it is packed; of the last chunk as it is.
  std::size_t size_bytes() const { return out_.size() + chunk_.size(); }
  /// The file's bytes. Nothing may be added after.
  std::string finish();

 private:
  struct ChunkIndex {
    std::uint64_t start_ns = 0, end_ns = 0, offset = 0, length = 0, index_length = 0, packed = 0, unpacked = 0;
    std::map<std::uint16_t, std::uint64_t> index_offsets;
  };
  void close_chunk();

  Compression compression_;
  std::string out_, chunk_;
  std::string schemas_, channels_;  ///< their records, repeated in the summary
  std::string metadata_indices_;
  std::uint32_t metadata_ = 0;
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> chunk_messages_;
  std::vector<ChunkIndex> indices_;
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::map<std::string, std::uint16_t> schema_ids_;
  std::map<std::uint16_t, std::uint32_t> sequence_;
};

}  // namespace palpate::io
