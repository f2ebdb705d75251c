// label: contract
// SPDX-License-Identifier: Apache-2.0
// What every container of messages promises, whoever wrote it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "io/bag_files.hpp"
#include "io/broken_bytes.hpp"
#include "io/recording_folder.hpp"
#include "palpate/io/file.hpp"

namespace palpate::io::bag_contract_test {
namespace {

using namespace palpate::io::test;
using testing::HasSubstr;

struct Container {
  const char* name;
  std::function<std::string(const std::vector<TestMessage>&)> write;
  const char* format;  ///< in bag_formats()
};

const Container containers[] = {
    {"mcap_none", [](const auto& m) { return mcap_bytes(m, McapWriter::Compression::none); }, "mcap"},
    {"mcap_zstd", [](const auto& m) { return mcap_bytes(m, McapWriter::Compression::zstd); }, "mcap"},
    {"mcap_unindexed", [](const auto& m) { return bare_mcap_bytes(m); }, "mcap"},
    {"sqlite3_schema_1", [](const auto& m) { return sqlite_bytes(m, 1); }, "sqlite3"},
    {"sqlite3_schema_4", [](const auto& m) { return sqlite_bytes(m, 4); }, "sqlite3"},
    {"ros1_none", [](const auto& m) { return ros1_bytes(m, "none"); }, "ros1"},
    {"ros1_bz2", [](const auto& m) { return ros1_bytes(m, "bz2"); }, "ros1"},
    {"ros1_lz4", [](const auto& m) { return ros1_bytes(m, "lz4"); }, "ros1"},
};

std::string noise(std::size_t size, unsigned seed) {
  std::mt19937 random(seed);
  std::string bytes(size, '\0');
  for (char& letter : bytes) letter = static_cast<char>(random() & 0xff);
  return bytes;
}

/// Two topics whose messages come out of order, and one of a type that nobody knows.
std::vector<TestMessage> mixed(std::size_t size = 20000) {
  std::vector<TestMessage> all;
  for (unsigned i = 0; i < 12; ++i) {
    all.push_back({"/camera/depth", "sensor_msgs/msg/Image", 5'000'000'000 + 100 * i, noise(size, i)});
    all.push_back({"/wrench", "geometry_msgs/msg/WrenchStamped", 5'000'000'010 + 100 * (11 - i), noise(50, 100 + i)});
  }
  all.push_back({"/battery", "vendor_msgs/msg/BatteryOfTheVendor", 5'000'000'005, noise(7, 200)});
  return all;
}

class EveryContainer : public testing::TestWithParam<Container> {
 protected:
  std::string bytes(const std::vector<TestMessage>& messages) const { return GetParam().write(messages); }
};

TEST_P(EveryContainer, GivesBackEveryMessageInTheOrderOfTime) {
  const std::vector<TestMessage> written = mixed();
  const MessageSource bag = parse_bag(bytes(written), "a");
  EXPECT_EQ(bag.format, GetParam().format);
  EXPECT_TRUE(bag.warnings.empty()) << bag.warnings.front();
  ASSERT_EQ(bag.topics.size(), 3u);
  EXPECT_EQ(bag.topics[0].name, "/battery");
  EXPECT_EQ(bag.topics[0].type, "vendor_msgs/msg/BatteryOfTheVendor") << "unknown types are listed like any other";
  EXPECT_EQ(bag.topics[1].name, "/camera/depth");
  EXPECT_EQ(bag.topics[1].messages, 12u);
  EXPECT_EQ(bag.topics[2].type, "geometry_msgs/msg/WrenchStamped");
  EXPECT_EQ(bag.topics[2].encoding, std::string(GetParam().format) == "ros1" ? MessageEncoding::ros1 : MessageEncoding::cdr);
  ASSERT_EQ(bag.messages.size(), written.size());
  std::map<std::pair<std::string, std::int64_t>, std::string> expected;
  for (const TestMessage& one : written) expected[{one.topic, one.time_ns}] = one.data;
  for (std::size_t i = 0; i < bag.messages.size(); ++i) {
    const Message& message = bag.messages[i];
    if (i > 0) {
      EXPECT_LE(bag.messages[i - 1].log_time_ns, message.log_time_ns);
    }
    EXPECT_EQ(message.data, (expected.at({bag.topics[message.topic].name, message.log_time_ns})));
  }
}

// One message logged before the clock was set was the bag's start, and every step came decades after it.
TEST_P(EveryContainer, AMessageOfAnotherCenturyIsLeftOutWithAWord) {
  std::vector<TestMessage> written = mixed(100);
  for (TestMessage& one : written) one.time_ns += 1'700'000'000'000'000'000;
  const std::size_t count = written.size();
  written.push_back({"/wrench", "geometry_msgs/msg/WrenchStamped", 0, noise(50, 300)});
  const MessageSource bag = parse_bag(bytes(written), "a");
  EXPECT_EQ(bag.messages.size(), count);
  EXPECT_EQ(bag.topics[2].messages, 12u);
  EXPECT_THAT(bag.warnings, testing::Contains(HasSubstr("1 messages are left out: their recorder's times lie days from all others")));
}

TEST_P(EveryContainer, MessagesOutliveTheSourceThatWasCopied) {
  MessageSource copy;
  {
    const MessageSource bag = parse_bag(bytes(mixed()), "a");
    copy = bag;
  }
  EXPECT_EQ(copy.messages.front().data, noise(20000, 0));
}

TEST_P(EveryContainer, WhatWasWrittenBeforeACutIsRead) {
  const std::string whole = bytes(mixed());
  std::size_t last = 0;
  for (std::size_t eighth = 2; eighth < 8; ++eighth) {
    const MessageSource bag = parse_bag(whole.substr(0, whole.size() * eighth / 8), "a");
    EXPECT_FALSE(bag.warnings.empty()) << eighth;
    EXPECT_GE(bag.messages.size(), last);
    EXPECT_LT(bag.messages.size(), 25u);
    for (const Message& message : bag.messages) {
      if (bag.topics[message.topic].name != "/camera/depth") continue;
      EXPECT_EQ(message.data, noise(20000, static_cast<unsigned>((message.log_time_ns - 5'000'000'000) / 100))) << eighth;
    }
    last = bag.messages.size();
  }
  EXPECT_GE(last, 8u) << "a quarter of a megabyte that is cut at 7/8, perhaps all of one chunk";
}

TEST_P(EveryContainer, ACutIsToldWithItsPlaceAndTime) {
  const std::string whole = bytes(mixed());
  const std::size_t cut = whole.size() * 3 / 4;
  const MessageSource bag = parse_bag(whole.substr(0, cut), "a");
  ASSERT_FALSE(bag.warnings.empty());
  EXPECT_THAT(bag.warnings[0], HasSubstr(std::to_string(cut)));
  EXPECT_THAT(bag.warnings[0], HasSubstr("5.000001 s"));
}

TEST_P(EveryContainer, DamageIsSurvived) {
  const Reader read = [](std::string_view bytes, const std::string& name) { parse_bag(std::string(bytes), name); };
  survives(read, damaged(bytes(mixed(300)), 80));
}

TEST_P(EveryContainer, ABagWithoutAMessageIsEmptyNotWrong) {
  const MessageSource bag = parse_bag(bytes({}), "a");
  EXPECT_TRUE(bag.messages.empty());
}

TEST_P(EveryContainer, IsRecognisedByItsContent) {
  const TemporaryFolder folder("bag_content");
  folder.put("a.dat", bytes(mixed(50)));
  EXPECT_TRUE(is_bag(folder.path() / "a.dat"));
  EXPECT_EQ(read_bag(folder.path() / "a.dat").messages.size(), 25u);
}

INSTANTIATE_TEST_SUITE_P(Bags, EveryContainer, testing::ValuesIn(containers),
                         [](const auto& one) { return std::string(one.param.name); });

/// Four messages a chunk: of a chunk that is not packed every message before the cut is whole.
TEST(Bags, ARos1BagThatIsCutWithinAChunkLosesOneMessage) {
  std::vector<TestMessage> all;
  for (unsigned i = 0; i < 12; ++i)
    all.push_back({"/wrench", "geometry_msgs/msg/WrenchStamped", 7'000'000'000 + 250'000'000 * i, noise(1000, i)});
  const std::string whole = ros1_bytes(all, "none");
  const std::size_t cut = whole.size() - 500;
  const MessageSource bag = parse_bag(whole.substr(0, cut), "a");
  EXPECT_EQ(bag.messages.size(), 11u);
  EXPECT_EQ(bag.messages.back().data, noise(1000, 10));
  ASSERT_EQ(bag.warnings.size(), 1u);
  EXPECT_THAT(bag.warnings[0], HasSubstr("cut off at byte " + std::to_string(cut)));
  EXPECT_THAT(bag.warnings[0], HasSubstr("is of 9.500000 s, 2.500 s after the first"));
  const std::size_t between = ros1_bytes({all.begin(), all.begin() + 8}, "none").size();
  std::string closed = whole.substr(0, between);
  const std::size_t index = closed.find("index_pos=") + 10;
  closed.replace(index, 8, bytes_of(std::uint64_t{whole.size()}));
  EXPECT_THAT(parse_bag(closed, "a").warnings, testing::ElementsAre(HasSubstr("cut off at byte " + std::to_string(between))))
      << "between two chunks of a bag that was closed";
}

TEST(Bags, EveryFormatIsInTheContract) {
  for (const BagFormat& format : bag_formats()) {
    EXPECT_TRUE(std::any_of(std::begin(containers), std::end(containers), [&](const Container& one) {
      return format.name == one.format;
    })) << format.name;
  }
}

TEST(Bags, WhatIsNoBagIsRefused) {
  const Reader read = [](std::string_view bytes, const std::string& name) { parse_bag(std::string(bytes), name); };
  for (const std::string& bytes : garbage()) EXPECT_TRUE(refuses(read, bytes));
  EXPECT_TRUE(refuses(read, ""));
  EXPECT_TRUE(refuses(read, "#ROSBAG V1.2\n"));
  sqlite3* database = nullptr;
  sqlite3_open(":memory:", &database);
  sqlite3_exec(database, "CREATE TABLE topics(id INTEGER)", nullptr, nullptr, nullptr);
  sqlite3_int64 size = 0;
  unsigned char* raw = sqlite3_serialize(database, "main", &size, 0);
  EXPECT_TRUE(refuses(read, std::string(reinterpret_cast<const char*>(raw), static_cast<std::size_t>(size))))
      << "another database";
  sqlite3_free(raw);
  sqlite3_close(database);
}

TEST(Bags, AFolderOfRosbag2IsReadByItsMetadata) {
  const TemporaryFolder folder("bag_folder");
  const std::vector<TestMessage> all = mixed(50);
  folder.put("part_0.db3", sqlite_bytes({all.begin(), all.begin() + 10}));
  folder.put("part_1.db3", sqlite_bytes({all.begin() + 10, all.end()}));
  EXPECT_TRUE(is_bag(folder.path()));
  const MessageSource without = read_bag(folder.path());
  EXPECT_EQ(without.messages.size(), 25u);
  ASSERT_EQ(without.warnings.size(), 1u);
  EXPECT_THAT(without.warnings[0], HasSubstr("metadata.yaml"));
  folder.put(
      "metadata.yaml",
      "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n  duration: {nanoseconds: 5}\n"
      "  relative_file_paths: [part_0.db3, part_1.db3, part_2.db3]\n  compression_format: \"\"\n  compression_mode: \"\"\n");
  const MessageSource bag = read_bag(folder.path());
  EXPECT_EQ(bag.topics.size(), 3u);
  EXPECT_EQ(bag.messages.size(), 25u);
  ASSERT_EQ(bag.warnings.size(), 1u);
  EXPECT_THAT(bag.warnings[0], HasSubstr("part_2.db3"));
}

TEST(Bags, ADatabaseThatWasLeftInWriteAheadModeIsRead) {
  std::string bytes = sqlite_bytes(mixed(50));
  bytes[18] = bytes[19] = 2;
  EXPECT_EQ(parse_bag(bytes, "a").messages.size(), 25u);
}

/// A recorder that was cut off leaves its last file empty, or with nothing but its first bytes.
TEST(Bags, AnEmptyFileOfAFolderCostsNothingElse) {
  for (const char* last : {"", "\x89MCAP0\r\n"}) {
    const TemporaryFolder folder("bag_empty_part");
    folder.put("part_0.mcap", mcap_bytes(mixed(50), McapWriter::Compression::zstd));
    folder.put("part_1.mcap", last);
    folder.put("metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths: [part_0.mcap, part_1.mcap]\n");
    const MessageSource bag = read_bag(folder.path());
    EXPECT_EQ(bag.messages.size(), 25u);
    EXPECT_THAT(bag.warnings, testing::ElementsAre(HasSubstr("'part_1.mcap' is left out: it is ")));
    std::filesystem::remove(folder.path() / "part_0.mcap");
    try {
      read_bag(folder.path());
      FAIL() << "nothing is left";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("part_1.mcap"));
    }
  }
}

TEST(Bags, AMissingFolderIsAnError) {
  EXPECT_FALSE(is_bag("/nowhere/at/all"));
  EXPECT_THROW(read_bag("/nowhere/at/all"), Error);
}

}  // namespace
}  // namespace palpate::io::bag_contract_test
