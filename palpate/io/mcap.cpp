// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/mcap.hpp"

#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/io/bag_formats.hpp"
#include "palpate/io/bytes.hpp"
#include "palpate/io/unpack.hpp"

namespace palpate::io {
namespace {

constexpr std::string_view mcap_magic = "\x89MCAP0\r\n";
enum Opcode : std::uint8_t {
  op_header = 0x01,
  op_footer = 0x02,
  op_schema = 0x03,
  op_channel = 0x04,
  op_message = 0x05,
  op_chunk = 0x06,
  op_message_index = 0x07,
  op_chunk_index = 0x08,
  op_statistics = 0x0B,
  op_metadata = 0x0C,
  op_metadata_index = 0x0D,
  op_summary_offset = 0x0E,
  op_data_end = 0x0F
};
constexpr std::size_t chunk_target = 1 << 20;

void text_field(std::string& out, std::string_view text) {
  store(out, static_cast<std::uint32_t>(text.size()));
  out += text;
}

void record(std::string& out, Opcode opcode, std::string_view content) {
  out += static_cast<char>(opcode);
  store(out, static_cast<std::uint64_t>(content.size()));
  out += content;
}

void notes_field(std::string& out, const McapWriter::Notes& notes) {
  std::string entries;
  for (const auto& [key, value] : notes) {
    text_field(entries, key);
    text_field(entries, value);
  }
  text_field(out, entries);
}

std::uint32_t checksum(std::string_view bytes) {
  return static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
}

}  // namespace

class McapParser {
 public:
  explicit McapParser(McapFile& file) : file_(file) {}

  /// Records one after the other; false when the bytes end within one.
  bool records(std::string_view bytes, bool in_chunk) {
    for (std::size_t at = 0; at < bytes.size();) {
      if (bytes.size() - at < 9) {
        cut_at_ = at;
        return false;
      }
      const auto opcode = static_cast<std::uint8_t>(bytes[at]);
      const auto size = load<std::uint64_t>(bytes.data() + at + 1);
      at += 9;
      if (opcode == op_footer && whole_) return true;
      if (size > bytes.size() - at) {
        cut_at_ = at - 9;
        if (opcode == op_chunk && !in_chunk) cut_chunk(ByteFields(bytes.substr(at)));
        return false;
      }
      const std::string_view content = bytes.substr(at, size);
      at += size;
      if (opcode == op_data_end && !in_chunk) whole_ = true;  // the summary that follows repeats schemas and channels
      if (!record_of(opcode, ByteFields(content), in_chunk)) ++damaged_;
    }
    cut_at_ = bytes.size();
    return in_chunk || whole_;
  }

  /// Where in the bytes the first record begins that is not whole.
  std::size_t cut_at() const { return cut_at_; }
  std::size_t damaged() const { return damaged_; }
  bool has_header() const { return has_header_; }

 private:
  bool record_of(std::uint8_t opcode, ByteFields fields, bool in_chunk) {
    if (opcode == op_header) {
      file_.profile = fields.text();
      file_.written_by = fields.text();
      has_header_ = true;
    } else if (opcode == op_schema) {
      const auto id = fields.number<std::uint16_t>();
      const std::string name = fields.text(), encoding = fields.text();
      if (fields.good) schemas_[id] = {name, encoding};
    } else if (opcode == op_channel) {
      McapChannel channel;
      channel.id = fields.number<std::uint16_t>();
      const auto schema = fields.number<std::uint16_t>();
      channel.topic = fields.text();
      channel.message_encoding = fields.text();
      if (!fields.good) return false;
      const auto found = schemas_.find(schema);
      if (found != schemas_.end()) channel.schema_name = found->second.first, channel.schema_encoding = found->second.second;
      file_.channels[channel.id] = channel;
    } else if (opcode == op_message) {
      McapMessage message;
      message.channel = fields.number<std::uint16_t>();
      fields.number<std::uint32_t>();  // sequence
      message.log_time_ns = fields.number<std::uint64_t>();
      message.publish_time_ns = fields.number<std::uint64_t>();
      if (!fields.good) return false;
      message.data = fields.rest();
      file_.messages.push_back(message);
    } else if (opcode == op_chunk && !in_chunk) {
      return chunk(fields);
    }
    return fields.good;  // other records are of no interest here
  }

  /// The file ends within this chunk: its first messages are whole all the same, though its check sum cannot be compared.
  void cut_chunk(ByteFields fields) {
    fields.number<std::uint64_t>();
    fields.number<std::uint64_t>();
    const auto size = fields.number<std::uint64_t>();
    fields.number<std::uint32_t>();
    const std::string compression = fields.text();
    fields.number<std::uint64_t>();
    if (!fields.good) return;
    std::string_view left = fields.rest();
    if (!compression.empty()) {
      file_.storage_.push_back(unpack_what_is_left(left, compression, size));
      left = file_.storage_.back();
    }
    const std::size_t here = cut_at_;
    records(left, true);
    cut_at_ = here;
  }

  bool chunk(ByteFields& fields) {
    fields.number<std::uint64_t>();  // first and last time
    fields.number<std::uint64_t>();
    const auto size = fields.number<std::uint64_t>();
    const auto crc = fields.number<std::uint32_t>();
    const std::string compression = fields.text();
    const std::string_view packed = fields.take(fields.number<std::uint64_t>());
    if (!fields.good) return false;
    std::string_view unpacked = packed;
    if (!compression.empty()) {
      auto out = unpack(packed, compression, size);
      if (!out) return false;
      file_.storage_.push_back(std::move(*out));
      unpacked = file_.storage_.back();
    }
    if (unpacked.size() != size || (crc != 0 && crc != checksum(unpacked))) return false;
    return records(unpacked, true);
  }

  McapFile& file_;
  std::map<std::uint16_t, std::pair<std::string, std::string>> schemas_;
  std::size_t damaged_ = 0, cut_at_ = 0;
  bool has_header_ = false, whole_ = false;
};

McapFile McapFile::parse(std::string bytes, const std::string& name) {
  McapFile file;
  file.storage_.push_back(std::move(bytes));
  const std::string_view all = file.storage_.front();
  if (all.substr(0, mcap_magic.size()) != mcap_magic) throw Error("does not start as an MCAP file does", name);
  McapParser parser(file);
  const bool whole = parser.records(all.substr(mcap_magic.size()), false);
  if (!parser.has_header()) throw Error("is cut off before its first record; record it again", name);
  // A channel that was lost with a damaged chunk is found in the summary, if there is one.
  const auto orphans = std::remove_if(file.messages.begin(), file.messages.end(),
                                      [&](const McapMessage& message) { return file.channels.count(message.channel) == 0; });
  if (orphans != file.messages.end()) {
    file.warnings.push_back(std::to_string(file.messages.end() - orphans) +
                            " messages of channels that are not described were left out");
    file.messages.erase(orphans, file.messages.end());
  }
  if (parser.damaged() > 0)
    file.warnings.push_back(std::to_string(parser.damaged()) + " damaged records or chunks were left out");
  std::stable_sort(file.messages.begin(), file.messages.end(),
                   [](const McapMessage& a, const McapMessage& b) { return a.log_time_ns < b.log_time_ns; });
  if (!whole) {
    const auto time = [&](const McapMessage& one) { return static_cast<std::int64_t>(one.log_time_ns); };
    const bool any = !file.messages.empty();
    file.warnings.insert(file.warnings.begin(),
                         cut_off_warning(all.size(), mcap_magic.size() + parser.cut_at(),
                                         any ? std::optional(time(file.messages.front())) : std::nullopt,
                                         any ? std::optional(time(file.messages.back())) : std::nullopt));
  }
  return file;
}

McapWriter::McapWriter(std::string profile, Compression compression) : compression_(compression), out_(mcap_magic) {
  std::string content;
  text_field(content, profile);
  text_field(content, "palpate");
  record(out_, op_header, content);
}

std::uint16_t McapWriter::add_channel(const std::string& topic, const std::string& schema_name,
                                      const std::string& schema_text, const std::string& schema_encoding,
                                      const std::string& message_encoding, const Notes& notes) {
  const auto [schema, is_new] = schema_ids_.try_emplace(schema_name, static_cast<std::uint16_t>(schema_ids_.size() + 1));
  if (is_new) {
    std::string content;
    store(content, schema->second);
    text_field(content, schema_name);
    text_field(content, schema_encoding);
    text_field(content, schema_text);
    record(schemas_, op_schema, content);
    record(chunk_, op_schema, content);
  }
  const auto id = static_cast<std::uint16_t>(counts_.size() + 1);  // rosbags 0.11.1 finds no message of a channel 0
  std::string content;
  store(content, id);
  store(content, schema->second);
  text_field(content, topic);
  text_field(content, message_encoding);
  notes_field(content, notes);
  record(channels_, op_channel, content);
  record(chunk_, op_channel, content);
  counts_[id] = 0;
  return id;
}

void McapWriter::add_metadata(const std::string& name, const Notes& notes) {
  close_chunk();
  std::string content;
  text_field(content, name);
  notes_field(content, notes);
  std::string index;
  store(index, static_cast<std::uint64_t>(out_.size()));
  record(out_, op_metadata, content);
  store(index, static_cast<std::uint64_t>(content.size() + 9));
  text_field(index, name);
  record(metadata_indices_, op_metadata_index, index);
  ++metadata_;
}

void McapWriter::add_message(std::uint16_t channel, std::uint64_t time_ns, std::string_view data) {
  const auto count = counts_.find(channel);
  if (count == counts_.end()) throw Error("there is no such channel", "McapWriter::add_message: channel");
  chunk_messages_[channel].emplace_back(time_ns, chunk_.size());
  std::string content;
  content.reserve(data.size() + 22);
  store(content, channel);
  store(content, sequence_[channel]++);
  store(content, time_ns);
  store(content, time_ns);
  content += data;
  record(chunk_, op_message, content);
  count->second += 1;
  if (chunk_.size() >= chunk_target) close_chunk();
}

void McapWriter::close_chunk() {
  if (chunk_.empty()) return;
  ChunkIndex index;
  index.start_ns = chunk_messages_.empty() ? 0 : std::numeric_limits<std::uint64_t>::max();
  for (const auto& [channel, messages] : chunk_messages_) {
    for (const auto& [time_ns, offset] : messages) {
      index.start_ns = std::min(index.start_ns, time_ns);
      index.end_ns = std::max(index.end_ns, time_ns);
    }
  }
  std::string packed = chunk_;
  if (compression_ == Compression::zstd) {
    packed.resize(ZSTD_compressBound(chunk_.size()));
    const std::size_t size = ZSTD_compress(packed.data(), packed.size(), chunk_.data(), chunk_.size(), 1);
    if (ZSTD_isError(size)) throw Error("a chunk cannot be compressed", "McapWriter");
    packed.resize(size);
  }
  std::string content;
  store(content, index.start_ns);
  store(content, index.end_ns);
  store(content, static_cast<std::uint64_t>(chunk_.size()));
  store(content, checksum(chunk_));
  text_field(content, compression_ == Compression::zstd ? "zstd" : "");
  store(content, static_cast<std::uint64_t>(packed.size()));
  content += packed;
  index.offset = out_.size();
  record(out_, op_chunk, content);
  index.length = out_.size() - index.offset;
  index.packed = packed.size();
  index.unpacked = chunk_.size();
  const std::size_t before = out_.size();
  for (const auto& [channel, messages] : chunk_messages_) {
    index.index_offsets[channel] = out_.size();
    std::string entry;
    store(entry, channel);
    store(entry, static_cast<std::uint32_t>(messages.size() * 16));
    for (const auto& [time_ns, offset] : messages) {
      store(entry, time_ns);
      store(entry, offset);
    }
    record(out_, op_message_index, entry);
  }
  index.index_length = out_.size() - before;
  indices_.push_back(std::move(index));
  chunk_.clear();
  chunk_messages_.clear();
}

std::string McapWriter::finish() {
  close_chunk();
  std::string content;
  store(content, std::uint32_t{0});  // no check sum of the data section; the chunks have theirs
  record(out_, op_data_end, content);

  const std::uint64_t summary = out_.size();
  std::string offsets;
  const auto group = [&](Opcode opcode, const std::string& records) {
    if (records.empty()) return;
    std::string entry(1, static_cast<char>(opcode));
    store(entry, static_cast<std::uint64_t>(out_.size()));
    store(entry, static_cast<std::uint64_t>(records.size()));
    record(offsets, op_summary_offset, entry);
    out_ += records;
  };
  group(op_schema, schemas_);
  group(op_channel, channels_);
  std::uint64_t start = std::numeric_limits<std::uint64_t>::max(), end = 0, total = 0;
  for (const ChunkIndex& index : indices_) start = std::min(start, index.start_ns), end = std::max(end, index.end_ns);
  for (const auto& [channel, count] : counts_) total += count;
  std::string statistics;
  store(statistics, total);
  store(statistics, static_cast<std::uint16_t>(schema_ids_.size()));
  store(statistics, static_cast<std::uint32_t>(counts_.size()));
  store(statistics, std::uint32_t{0});
  store(statistics, metadata_);
  store(statistics, static_cast<std::uint32_t>(indices_.size()));
  store(statistics, indices_.empty() ? 0 : start);
  store(statistics, end);
  store(statistics, static_cast<std::uint32_t>(counts_.size() * 10));
  for (const auto& [channel, count] : counts_) {
    store(statistics, channel);
    store(statistics, count);
  }
  std::string statistics_record;
  record(statistics_record, op_statistics, statistics);
  group(op_statistics, statistics_record);
  std::string chunk_indices;
  for (const ChunkIndex& index : indices_) {
    std::string entry;
    for (const std::uint64_t value : {index.start_ns, index.end_ns, index.offset, index.length}) store(entry, value);
    store(entry, static_cast<std::uint32_t>(index.index_offsets.size() * 10));
    for (const auto& [channel, offset] : index.index_offsets) {
      store(entry, channel);
      store(entry, offset);
    }
    store(entry, index.index_length);
    text_field(entry, compression_ == Compression::zstd ? "zstd" : "");
    store(entry, index.packed);
    store(entry, index.unpacked);
    record(chunk_indices, op_chunk_index, entry);
  }
  group(op_chunk_index, chunk_indices);
  group(op_metadata_index, metadata_indices_);
  const std::uint64_t summary_offsets = out_.size();
  out_ += offsets;
  // The check sum runs over the summary, its offsets and the footer up to itself.
  std::string footer(1, static_cast<char>(op_footer));
  store(footer, std::uint64_t{20});
  store(footer, summary);
  store(footer, summary_offsets);
  out_ += footer;
  store(out_, checksum(std::string_view(out_).substr(summary)));
  out_ += mcap_magic;
  return std::move(out_);
}

}  // namespace palpate::io
