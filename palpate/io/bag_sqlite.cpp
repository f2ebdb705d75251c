// SPDX-License-Identifier: Apache-2.0
// rosbag2's older container (rosbag2_storage_sqlite3): table `topics` (id, name, type, serialization_format) and table
// `messages` (topic_id, timestamp in ns, data). SQLite itself reads it, from memory.
#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <map>

#include "palpate/core/error.hpp"
#include "palpate/io/bag_formats.hpp"
#include "palpate/io/bytes.hpp"

namespace palpate::io {
namespace {

struct Statement {
  Statement(sqlite3* database, const char* query) { code = sqlite3_prepare_v2(database, query, -1, &handle, nullptr); }
  ~Statement() { sqlite3_finalize(handle); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  bool next() { return code == SQLITE_OK && (code = sqlite3_step(handle)) == SQLITE_ROW && (code = SQLITE_OK, true); }
  bool is_done() const { return code == SQLITE_DONE; }
  std::string text(int column) const {
    const unsigned char* value = sqlite3_column_text(handle, column);
    return value == nullptr ? std::string() : reinterpret_cast<const char*>(value);
  }
  sqlite3_stmt* handle = nullptr;
  int code = SQLITE_OK;
};

/// The file with what a cut or a crash does to it undone as far as it goes: SQLite refuses a file that is shorter than its
/// header says, and a journal mode that memory does not have. True when it was cut off.
bool mend(std::string& bytes) {
  constexpr std::size_t header_size = 100;
  if (bytes.size() < header_size) return true;
  bytes[18] = bytes[19] = 1;  // write-ahead log: there is none beside a file in memory
  const auto stored = load<std::uint16_t>(bytes.data() + 16, std::endian::big);
  const std::size_t page = stored == 1 ? 65536 : stored, pages = load<std::uint32_t>(bytes.data() + 28, std::endian::big);
  if (page < 512 || bytes.size() >= page * pages) return bytes.size() % std::max<std::size_t>(page, 1) != 0;
  constexpr std::size_t most = 64;  // of a bag of which less is left there is nothing to be read
  if (pages > most * bytes.size() / page + most) return true;
  bytes.resize(page * pages, '\0');
  return true;
}

struct Row {
  std::size_t topic;
  std::int64_t time_ns;
};

std::string cut_or_damaged(const std::vector<Row>& found, std::size_t file_bytes) {
  const std::string where = fmt::format("the file of {} bytes is cut off or damaged: ", file_bytes);
  if (found.empty()) return where + "there is no message to be read";
  const auto [first, last] = std::minmax_element(found.begin(), found.end(),
                                                 [](const Row& a, const Row& b) { return a.time_ns < b.time_ns; });
  return fmt::format("{}what could be read up to there is read, {} messages; the last is of {:.6f} s, {:.3f} s after the first",
                     where, found.size(), 1e-9 * static_cast<double>(last->time_ns),
                     1e-9 * static_cast<double>(last->time_ns - first->time_ns));
}

struct Storage {
  sqlite3* database = nullptr;
  std::string bytes;
  std::vector<std::string> data;
  ~Storage() { sqlite3_close(database); }
};

}  // namespace

MessageSource parse_sqlite_bag(std::string bytes, const std::string& name) {
  const auto storage = std::make_shared<Storage>();
  const std::size_t file_bytes = bytes.size();
  storage->bytes = std::move(bytes);
  const bool is_cut = mend(storage->bytes);
  auto* raw = reinterpret_cast<unsigned char*>(storage->bytes.data());
  const auto size = static_cast<sqlite3_int64>(storage->bytes.size());
  if (sqlite3_open_v2(":memory:", &storage->database, SQLITE_OPEN_READWRITE, nullptr) != SQLITE_OK ||
      sqlite3_deserialize(storage->database, "main", raw, size, size, SQLITE_DESERIALIZE_READONLY) != SQLITE_OK) {
    throw Error("cannot be opened as a database", name);
  }
  sqlite3* database = storage->database;
  sqlite3_db_config(database, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(database, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  {
    Statement tables(database, "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages')");
    if (!tables.next())
      throw Error(
          is_cut ? "is cut off before its tables; record it again" : "is damaged: " + std::string(sqlite3_errmsg(database)),
          name);
    if (sqlite3_column_int(tables.handle, 0) != 2)
      throw Error("is a database, but not a bag: it has no tables 'topics' and 'messages'", name);
  }
  MessageCollector collector;
  std::map<sqlite3_int64, std::size_t> place;
  Statement topics(database, "SELECT id, name, type, serialization_format FROM topics");
  while (topics.next()) {
    const std::string format = topics.text(3);
    place[sqlite3_column_int64(topics.handle, 0)] =
        collector.topic(topics.text(1), topics.text(2), format == "cdr" ? MessageEncoding::cdr : MessageEncoding::other);
  }
  if (!topics.is_done()) throw Error("is damaged: the table of topics cannot be read", name);
  // In the order of the rows, without the index, which a crash may have left behind.
  Statement rows(database, "SELECT topic_id, timestamp, data FROM messages NOT INDEXED");
  std::vector<Row> found;
  std::size_t orphans = 0;
  while (rows.next()) {
    const auto topic = place.find(sqlite3_column_int64(rows.handle, 0));
    if (topic == place.end()) {
      ++orphans;
      continue;
    }
    const auto* blob = static_cast<const char*>(sqlite3_column_blob(rows.handle, 2));
    const auto length = static_cast<std::size_t>(sqlite3_column_bytes(rows.handle, 2));
    found.push_back({topic->second, sqlite3_column_int64(rows.handle, 1)});
    storage->data.emplace_back(blob == nullptr ? std::string() : std::string(blob, length));
  }
  for (std::size_t i = 0; i < found.size(); ++i) collector.add(found[i].topic, found[i].time_ns, storage->data[i]);
  if (!rows.is_done() || is_cut)
    collector.warnings.push_back(cut_or_damaged(found, file_bytes));
  if (orphans > 0)
    collector.warnings.push_back(std::to_string(orphans) + " messages of topics that are not described were left out");
  return collector.finish(storage, name);
}

}  // namespace palpate::io
