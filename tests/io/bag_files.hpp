// SPDX-License-Identifier: Apache-2.0
// The same messages in every container, written by the tests' own hands: the product writes MCAP only.
#pragma once

#include <bzlib.h>
#include <lz4frame.h>
#include <sqlite3.h>

#include <map>
#include <string>
#include <vector>

#include "palpate/io/bytes.hpp"
#include "palpate/io/mcap.hpp"
#include "palpate/io/message_source.hpp"

namespace palpate::io::test {

struct TestMessage {
  std::string topic, type;  ///< "geometry_msgs/msg/WrenchStamped"
  std::int64_t time_ns = 0;
  std::string data;
};

inline void put_text(std::string& out, std::string_view text) {
  store(out, static_cast<std::uint32_t>(text.size()));
  out += text;
}

template <typename T>
std::string bytes_of(T value) {
  std::string out;
  store(out, value);
  return out;
}

// MCAP -------------------------------------------------------------------------------------------------------------------
inline std::string mcap_bytes(const std::vector<TestMessage>& messages, McapWriter::Compression compression) {
  McapWriter writer("ros2", compression);
  std::map<std::string, std::uint16_t> channels;
  for (const TestMessage& one : messages) {
    if (!channels.count(one.topic)) channels[one.topic] = writer.add_channel(one.topic, one.type, "# none\n");
    writer.add_message(channels[one.topic], static_cast<std::uint64_t>(one.time_ns), one.data);
  }
  return writer.finish();
}

/// Without chunks, index and summary, as a recorder without a buffer writes it.
inline std::string bare_mcap_bytes(const std::vector<TestMessage>& messages) {
  std::string out = "\x89MCAP0\r\n";
  const auto record = [&](char opcode, const std::string& content) {
    out += opcode;
    store(out, static_cast<std::uint64_t>(content.size()));
    out += content;
  };
  std::string head;
  put_text(head, "ros2");
  put_text(head, "test");
  record(1, head);
  std::map<std::string, std::uint16_t> channels;
  for (const TestMessage& one : messages) {
    if (!channels.count(one.topic)) {
      const auto id = static_cast<std::uint16_t>(channels.size());
      channels[one.topic] = id;
      std::string schema = bytes_of(static_cast<std::uint16_t>(id + 1));
      for (const std::string& text : {one.type, std::string("ros2msg"), std::string("# none\n")}) put_text(schema, text);
      record(3, schema);
      std::string channel = bytes_of(id) + bytes_of(static_cast<std::uint16_t>(id + 1));
      put_text(channel, one.topic);
      put_text(channel, "cdr");
      store(channel, std::uint32_t{0});
      record(4, channel);
    }
    record(5, bytes_of(channels[one.topic]) + bytes_of(std::uint32_t{0}) + bytes_of(one.time_ns) + bytes_of(one.time_ns) +
                  one.data);
  }
  record(15, bytes_of(std::uint32_t{0}));
  record(2, bytes_of(std::uint64_t{0}) + bytes_of(std::uint64_t{0}) + bytes_of(std::uint32_t{0}));
  return out + "\x89MCAP0\r\n";
}

// ROS 1 ------------------------------------------------------------------------------------------------------------------
/// CDR starts with four bytes of its own; the contract only compares bytes, so that the payload may be anything.
inline std::string ros1_bytes(const std::vector<TestMessage>& messages, const std::string& compression,
                              std::size_t in_chunk = 4) {
  const auto fields = [](const std::vector<std::pair<std::string, std::string>>& list) {
    std::string out;
    for (const auto& [name, value] : list) put_text(out, name + "=" + value);
    return out;
  };
  const auto record = [&](std::string& out, const std::vector<std::pair<std::string, std::string>>& list,
                          const std::string& data) {
    put_text(out, fields(list));
    put_text(out, data);
  };
  const auto ros1_type = [](std::string type) { return type.erase(type.find("/msg"), 4); };
  std::string out = "#ROSBAG V2.0\n", chunk;
  record(
      out,
      {{"op", "\x03"}, {"index_pos", bytes_of(std::uint64_t{0})}, {"conn_count", bytes_of(0)}, {"chunk_count", bytes_of(0)}},
      std::string(64, ' '));
  const auto close = [&] {
    if (chunk.empty()) return;
    std::string packed = chunk;
    if (compression == "bz2") {
      packed.resize(chunk.size() * 2 + 600);
      auto size = static_cast<unsigned>(packed.size());
      BZ2_bzBuffToBuffCompress(packed.data(), &size, chunk.data(), static_cast<unsigned>(chunk.size()), 9, 0, 0);
      packed.resize(size);
    } else if (compression == "lz4") {
      packed.resize(LZ4F_compressFrameBound(chunk.size(), nullptr));
      packed.resize(LZ4F_compressFrame(packed.data(), packed.size(), chunk.data(), chunk.size(), nullptr));
    }
    record(out, {{"op", "\x05"}, {"compression", compression}, {"size", bytes_of(static_cast<std::uint32_t>(chunk.size()))}},
           packed);
    chunk.clear();
  };
  std::map<std::string, std::uint32_t> connections;
  std::size_t count = 0;
  for (const TestMessage& one : messages) {
    if (!connections.count(one.topic)) {
      const auto id = static_cast<std::uint32_t>(connections.size());
      connections[one.topic] = id;
      record(chunk, {{"op", "\x07"}, {"conn", bytes_of(id)}, {"topic", one.topic}},
             fields({{"topic", one.topic}, {"type", ros1_type(one.type)}, {"md5sum", "*"}, {"message_definition", ""}}));
    }
    const std::string time = bytes_of(static_cast<std::uint32_t>(one.time_ns / 1000000000)) +
                             bytes_of(static_cast<std::uint32_t>(one.time_ns % 1000000000));
    record(chunk, {{"op", "\x02"}, {"conn", bytes_of(connections[one.topic])}, {"time", time}}, one.data);
    if (++count % in_chunk == 0) close();
  }
  close();
  return out;
}

// sqlite3 ----------------------------------------------------------------------------------------------------------------
/// The statements of rosbag2's own source, SqliteStorage::initialize() of sqlite_storage.cpp.
/// @param schema  1: Crystal to Eloquent; 2: Foxy and Galactic; 3: Humble; 4: Iron, Jazzy, Rolling
inline std::string sqlite_bytes(const std::vector<TestMessage>& messages, int schema = 4) {
  sqlite3* database = nullptr;
  sqlite3_open(":memory:", &database);
  const auto run = [&](const std::string& query) { sqlite3_exec(database, query.c_str(), nullptr, nullptr, nullptr); };
  if (schema >= 3) {
    run("CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL);"
        "CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT NOT NULL);"
        "INSERT INTO schema VALUES(" + std::to_string(schema) + ",'rolling')");
  }
  run(std::string("CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,"
                  "serialization_format TEXT NOT NULL") +
      (schema >= 2 ? ",offered_qos_profiles TEXT NOT NULL" : "") +
      (schema >= 4 ? ",type_description_hash TEXT NOT NULL" : "") + ")");
  if (schema >= 4) {
    run("CREATE TABLE message_definitions(id INTEGER PRIMARY KEY,topic_type TEXT NOT NULL,encoding TEXT NOT NULL,"
        "encoded_message_definition TEXT NOT NULL,type_description_hash TEXT NOT NULL)");
  }
  run("CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB NOT "
      "NULL);"
      "CREATE INDEX timestamp_idx ON messages (timestamp ASC)");
  std::map<std::string, int> ids;
  for (const TestMessage& one : messages) {
    if (!ids.count(one.topic)) {
      ids[one.topic] = static_cast<int>(ids.size()) + 1;
      run("INSERT INTO topics VALUES(" + std::to_string(ids[one.topic]) + ",'" + one.topic + "','" + one.type +
          "','cdr'" + (schema >= 2 ? ",''" : "") + (schema >= 4 ? ",'RIHS01_0'" : "") + ")");
      if (schema >= 4)
        run("INSERT INTO message_definitions VALUES(NULL,'" + one.type + "','ros2msg','# none','RIHS01_0')");
    }
    sqlite3_stmt* row = nullptr;
    sqlite3_prepare_v2(database, "INSERT INTO messages(topic_id,timestamp,data) VALUES(?,?,?)", -1, &row, nullptr);
    sqlite3_bind_int(row, 1, ids[one.topic]);
    sqlite3_bind_int64(row, 2, one.time_ns);
    sqlite3_bind_blob(row, 3, one.data.data(), static_cast<int>(one.data.size()), SQLITE_TRANSIENT);
    sqlite3_step(row);
    sqlite3_finalize(row);
  }
  sqlite3_int64 size = 0;
  unsigned char* raw = sqlite3_serialize(database, "main", &size, 0);
  std::string bytes(reinterpret_cast<const char*>(raw), static_cast<std::size_t>(size));
  sqlite3_free(raw);
  sqlite3_close(database);
  return bytes;
}

}  // namespace palpate::io::test
