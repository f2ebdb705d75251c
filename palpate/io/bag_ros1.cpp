// SPDX-License-Identifier: Apache-2.0
// ROS 1 bags, version 2.0 (wiki.ros.org/Bags/Format/2.0): records of a header (fields `name=value`) and data; messages and
// the connections that they came over stand in chunks. Read front to back, without the index at the end, so that a bag that
// was never closed (.bag.active) is read as well.
#include <algorithm>
#include <deque>
#include <map>
#include <optional>

#include "palpate/core/error.hpp"
#include "palpate/io/bag_formats.hpp"
#include "palpate/io/bytes.hpp"
#include "palpate/io/unpack.hpp"

namespace palpate::io {
namespace {

constexpr std::string_view ros1_magic = "#ROSBAG V2.0\n";
enum Operation : std::uint8_t { op_message = 2, op_bag = 3, op_chunk = 5, op_connection = 7 };

using Fields = std::map<std::string, std::string_view, std::less<>>;

std::optional<Fields> fields_of(std::string_view bytes) {
  Fields header;
  ByteFields fields(bytes);
  while (!fields.at_end()) {
    const std::string_view field = fields.view();
    const std::size_t equals = field.find('=');
    if (!fields.good || equals == std::string_view::npos) return std::nullopt;
    header.emplace(field.substr(0, equals), field.substr(equals + 1));
  }
  return header;
}

template <typename T>
std::optional<T> number_of(const Fields& header, std::string_view name) {
  const auto found = header.find(name);
  if (found == header.end() || found->second.size() != sizeof(T)) return std::nullopt;
  return load<T>(found->second.data());
}

std::string text_of(const Fields& header, std::string_view name) {
  const auto found = header.find(name);
  return found == header.end() ? std::string() : std::string(found->second);
}

class Ros1Parser {
 public:
  explicit Ros1Parser(std::deque<std::string>& storage) : storage_(storage) {}

  /// Records one after the other; false when the bytes end within one.
  bool records(std::string_view bytes, bool in_chunk) {
    ByteFields fields(bytes);
    while (!fields.at_end()) {
      const std::size_t begin = fields.position();
      const std::string_view head = fields.view();
      const bool has_head = fields.good;
      const std::string_view data = fields.view();
      if (!fields.good) {
        if (!in_chunk) cut_at_ = ros1_magic.size() + begin;
        if (!in_chunk && has_head) cut_chunk(head, fields.rest());
        return false;
      }
      const auto header = fields_of(head);
      if (!header || !record(*header, data, in_chunk)) ++damaged_;
    }
    return true;
  }

  /// What the file's length says against its header: it was closed, and its index lies beyond its end.
  bool lacks_index(std::size_t file_bytes) const { return index_at_ > file_bytes; }
  std::size_t cut_at() const { return cut_at_; }
  std::optional<std::int64_t> first_ns() const { return edge([](const auto& a, const auto& b) { return a.time_ns < b.time_ns; }); }
  std::optional<std::int64_t> last_ns() const { return edge([](const auto& a, const auto& b) { return a.time_ns > b.time_ns; }); }

  MessageCollector collector;
  std::size_t damaged() const { return damaged_; }
  std::size_t orphans() const { return orphans_; }

  /// Messages wait until all connections are known: a damaged chunk may have held the connection of a later message.
  void settle() {
    for (const Waiting& one : waiting_) {
      const auto connection = connections_.find(one.connection);
      connection == connections_.end() ? void(++orphans_) : collector.add(connection->second, one.time_ns, one.data);
    }
  }

 private:
  struct Waiting {
    std::uint32_t connection;
    std::int64_t time_ns;
    std::string_view data;
  };

  template <typename Before>
  std::optional<std::int64_t> edge(Before before) const {
    const auto found = std::min_element(waiting_.begin(), waiting_.end(), before);
    return found == waiting_.end() ? std::nullopt : std::optional(found->time_ns);
  }

  /// The file ends within this chunk: its first messages are whole all the same.
  void cut_chunk(std::string_view head, std::string_view data) {
    const auto header = fields_of(head);
    if (!header || number_of<std::uint8_t>(*header, "op") != op_chunk) return;
    const auto size = number_of<std::uint32_t>(*header, "size");
    if (!size) return;
    const std::string compression = text_of(*header, "compression");
    if (compression != "none") {
      storage_.push_back(unpack_what_is_left(data, compression, *size));
      data = storage_.back();
    }
    records(data, true);
  }

  bool record(const Fields& header, std::string_view data, bool in_chunk) {
    const auto op = number_of<std::uint8_t>(header, "op");
    if (!op) return false;
    if (*op == op_bag) {
      if (!text_of(header, "encryptor").empty()) throw Error("is encrypted; record it without encryption", "bag");
      index_at_ = number_of<std::uint64_t>(header, "index_pos").value_or(0);
    } else if (*op == op_connection) {
      const auto id = number_of<std::uint32_t>(header, "conn");
      const auto inner = fields_of(data);
      const std::string topic = text_of(header, "topic");
      if (!id || !inner || topic.empty()) return false;
      connections_[*id] = collector.topic(topic, text_of(*inner, "type"), MessageEncoding::ros1);
    } else if (*op == op_message) {
      const auto id = number_of<std::uint32_t>(header, "conn");
      const auto time = number_of<std::uint64_t>(header, "time");  // seconds, then nanoseconds: 32 bits each
      if (!id || !time) return false;
      waiting_.push_back({*id, static_cast<std::int64_t>((*time & 0xffffffffu) * 1000000000u + (*time >> 32)), data});
    } else if (*op == op_chunk && !in_chunk) {
      const auto size = number_of<std::uint32_t>(header, "size");
      const std::string compression = text_of(header, "compression");
      if (!size) return false;
      if (compression == "none") return data.size() == *size && records(data, true);
      auto unpacked = unpack(data, compression, *size);
      if (!unpacked) return false;
      storage_.push_back(std::move(*unpacked));
      return records(storage_.back(), true);
    }
    return true;  // indices are not needed
  }

  std::deque<std::string>& storage_;
  std::map<std::uint32_t, std::size_t> connections_;
  std::vector<Waiting> waiting_;
  std::size_t damaged_ = 0, orphans_ = 0, cut_at_ = 0;
  std::uint64_t index_at_ = 0;
};

}  // namespace

MessageSource parse_ros1_bag(std::string bytes, const std::string& name) {
  const auto storage = std::make_shared<std::deque<std::string>>();  // addresses stay
  storage->push_back(std::move(bytes));
  const std::string_view all = storage->front();
  if (!all.starts_with(ros1_magic)) throw Error("is not of version 2.0; convert it with `rosbag fix` or `rosbag reindex`", name);
  Ros1Parser parser(*storage);
  try {
    const bool whole = parser.records(all.substr(ros1_magic.size()), false);
    if (!whole || parser.lacks_index(all.size()))
      parser.collector.warnings.push_back(
          cut_off_warning(all.size(), whole ? all.size() : parser.cut_at(), parser.first_ns(), parser.last_ns()));
  } catch (const Error& error) {
    throw Error(error.message(), name);
  }
  parser.settle();
  if (parser.orphans() > 0)
    parser.collector.warnings.push_back(std::to_string(parser.orphans()) +
                                        " messages of connections that are not described were left out");
  if (parser.damaged() > 0)
    parser.collector.warnings.push_back(std::to_string(parser.damaged()) + " damaged records or chunks were left out");
  return parser.collector.finish(storage, name);
}

}  // namespace palpate::io
