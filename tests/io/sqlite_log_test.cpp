// label: unit
// SPDX-License-Identifier: Apache-2.0
// Databases whose recorder was killed, with the log that SQLite itself wrote.
#include "palpate/io/sqlite_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "io/recording_folder.hpp"
#include "palpate/io/message_source.hpp"

namespace palpate::io::sqlite_log_test {
namespace {

using namespace palpate::io::test;
using testing::HasSubstr;

constexpr int batches = 20, batch = 50;

/// The files of a recorder that never closed the database: what was written before `kept` batches is in it, the rest in the log.
void put_unclosed(const TemporaryFolder& folder, int kept, int page_bytes = 4096) {
  const std::string file = (folder.path() / "open.sqlite").string();
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
  const auto run = [&](const std::string& query) {
    char* why = nullptr;
    EXPECT_EQ(sqlite3_exec(database, query.c_str(), nullptr, nullptr, &why), SQLITE_OK) << why;
  };
  run("PRAGMA page_size=" + std::to_string(page_bytes));
  run("PRAGMA journal_mode=WAL");
  run("PRAGMA wal_autocheckpoint=0");
  run("CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
      "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
      "INSERT INTO topics VALUES(1,'/wrench','geometry_msgs/msg/WrenchStamped','cdr')");
  for (int k = 0; k < batches; ++k) {
    if (k == kept && k > 0) run("PRAGMA wal_checkpoint(RESTART)");
    std::string rows;
    for (int i = k * batch; i < (k + 1) * batch; ++i)
      rows += (rows.empty() ? "" : ",") + ("(1," + std::to_string(1000 + i) + ",x'00010000" + std::string(200, 'a' + i % 6) + "')");
    run("INSERT INTO messages(topic_id,timestamp,data) VALUES " + rows);
  }
  folder.put("x.db3", folder.get("open.sqlite"));
  folder.put("x.db3-wal", folder.get("open.sqlite-wal"));
  sqlite3_close(database);
}

std::string hex_of(int i) { return std::string(100, static_cast<char>(0x11 * (10 + i % 6))); }

void expect_the_first(const MessageSource& bag, std::size_t messages) {
  ASSERT_EQ(bag.messages.size(), messages);
  for (std::size_t i = 0; i < messages; ++i) {
    EXPECT_EQ(bag.messages[i].log_time_ns, 1000 + static_cast<std::int64_t>(i));
    EXPECT_EQ(bag.messages[i].data.substr(4), hex_of(static_cast<int>(i)));
  }
}

TEST(SqliteLog, WhatARecorderThatWasKilledLeftInItIsRead) {
  for (const int kept : {0, 1, 7, batches - 1}) {
    for (const int page_bytes : {512, 4096, 65536}) {
      SCOPED_TRACE(std::to_string(kept) + " batches in the database, pages of " + std::to_string(page_bytes));
      const TemporaryFolder folder("sqlite_log");
      put_unclosed(folder, kept, page_bytes);
      const std::string before = folder.get("x.db3");
      const MessageSource bag = read_bag(folder.path() / "x.db3");
      expect_the_first(bag, batches * batch);
      ASSERT_FALSE(bag.warnings.empty());
      EXPECT_THAT(bag.warnings.back(), testing::EndsWith("'x.db3-wal' is read as well"));
      EXPECT_EQ(folder.get("x.db3"), before) << "the user's files stay as they are";
    }
  }
}

/// A cut or a flipped bit costs the transaction that it hits and what follows.
TEST(SqliteLog, WholeTransactionsBeforeADamageAreRead) {
  const TemporaryFolder folder("sqlite_log");
  put_unclosed(folder, 0);
  const std::string log = folder.get("x.db3-wal");
  std::size_t last = 0;
  for (std::size_t eighth = 2; eighth <= 8; ++eighth) {
    const std::size_t at = log.size() * eighth / 8 - 1;
    std::string flipped = log;
    flipped[at] = static_cast<char>(flipped[at] ^ 4);
    std::vector<std::size_t> messages;
    for (const std::string& damaged : {log.substr(0, at), flipped}) {
      folder.put("x.db3-wal", damaged);
      const MessageSource bag = read_bag(folder.path() / "x.db3");
      messages.push_back(bag.messages.size());
      EXPECT_EQ(messages.back() % batch, 0u);
      expect_the_first(bag, messages.back());
      EXPECT_THAT(bag.warnings.back(), HasSubstr("bytes, which are no whole transaction"));
    }
    EXPECT_EQ(messages[0], messages[1]);
    EXPECT_GE(messages[0], last);
    last = messages[0];
  }
  EXPECT_EQ(last, std::size_t((batches - 1) * batch));
}

TEST(SqliteLog, WhatIsNoLogIsSaid) {
  const TemporaryFolder folder("sqlite_log");
  put_unclosed(folder, batches - 1);
  std::string log = folder.get("x.db3-wal");
  log[9] = 1;
  for (const std::string& other : {std::string("pages"), log}) {
    folder.put("x.db3-wal", other);
    for (const auto& path : {folder.path() / "x.db3", folder.path()})
      EXPECT_THAT(read_bag(path).warnings, testing::Contains(HasSubstr("'x.db3-wal' is not read"))) << path;
  }
  std::string bytes = "unchanged";
  EXPECT_FALSE(fold_in_log(bytes, log));
  EXPECT_EQ(bytes, "unchanged");
}

}  // namespace
}  // namespace palpate::io::sqlite_log_test
