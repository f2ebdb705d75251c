// label: contract
// SPDX-License-Identifier: Apache-2.0
// What each version of rosbag2 writes is read: its databases, its metadata.yaml, packed or not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/rosbag2_files.hpp"
#include "palpate/core/error.hpp"

namespace palpate::io::rosbag2_test {
namespace {

using namespace palpate::io::test;
using testing::ElementsAre;
using testing::HasSubstr;

/// As CDR begins: 0, and 1 for the least significant byte first.
std::vector<TestMessage> pushes() {
  std::vector<TestMessage> all;
  for (int i = 0; i < 6; ++i) {
    const std::string data = std::string("\0\1\0\0", 4) + std::string(300, static_cast<char>('a' + i));
    all.push_back({"/wrench", "geometry_msgs/msg/WrenchStamped", 1'700'000'000'000'000'000 + 1000 * i, data});
    all.push_back({"/camera/depth", "sensor_msgs/msg/Image", 1'700'000'000'000'000'001 + 1000 * i, data + data});
  }
  return all;
}

void expect_the_pushes(const MessageSource& bag) {
  const std::vector<TestMessage> all = pushes();
  ASSERT_EQ(bag.messages.size(), all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(bag.topics[bag.messages[i].topic].name, all[i].topic);
    EXPECT_EQ(bag.topics[bag.messages[i].topic].type, all[i].type);
    EXPECT_EQ(bag.messages[i].log_time_ns, all[i].time_ns);
    EXPECT_EQ(bag.messages[i].data, all[i].data);
  }
}

TEST(Rosbag2, EverySchemaOfItsDatabaseIsRead) {
  for (const int schema : {1, 2, 3, 4}) {
    SCOPED_TRACE(schema);
    const MessageSource bag = parse_bag(sqlite_bytes(pushes(), schema), "a");
    EXPECT_TRUE(bag.warnings.empty()) << bag.warnings.front();
    expect_the_pushes(bag);
  }
}

/// rosbag2 says the mode in capitals, rosbags (Ternaris) in small letters.
TEST(Rosbag2, EveryVersionOfItsMetadataIsRead) {
  for (int version = 1; version <= 9; ++version) {
    for (const char* storage : {"mcap", "sqlite3"}) {
      for (const char* mode : {"", "NONE", "FILE", "MESSAGE", "file", "message"}) {
        SCOPED_TRACE(std::to_string(version) + " " + storage + " " + mode);
        if (version < 3 && *mode != '\0') continue;
        const Rosbag2Form form{version, storage, mode};
        const TemporaryFolder folder("rosbag2_version");
        const std::string file = put_rosbag2_file(folder, form, pushes());
        // Up to version 3, and of packed files in version 4, too, the bag's name stands before the file's.
        folder.put("metadata.yaml", rosbag2_metadata_text(form, pushes(), {version <= 4 ? "bag/" + file : file}));
        const MessageSource bag = read_bag(folder.path());
        EXPECT_TRUE(bag.warnings.empty()) << bag.warnings.front();
        expect_the_pushes(bag);
      }
    }
  }
}

/// A recorder that was cut off writes no metadata.yaml, and people pass on single files.
TEST(Rosbag2, PackedMessagesAreUnpackedWithoutMetadata) {
  for (const char* storage : {"mcap", "sqlite3"}) {
    const TemporaryFolder folder("rosbag2_messages");
    const std::string file = put_rosbag2_file(folder, {9, storage, "MESSAGE"}, pushes());
    expect_the_pushes(read_bag(folder.path()));
    expect_the_pushes(read_bag(folder.path() / file));
  }
}

TEST(Rosbag2, PackedMessagesThatAreDamagedAreCounted) {
  std::vector<TestMessage> all = pushes();
  for (TestMessage& one : all) one.data = packed(one.data);
  all[3].data.resize(8);
  const TemporaryFolder folder("rosbag2_damaged");
  folder.put("bag_0.db3", sqlite_bytes(all));
  EXPECT_THAT(read_bag(folder.path() / "bag_0.db3").warnings, ElementsAre("1 messages could not be unpacked"));
}

TEST(Rosbag2, AnotherCompressionIsRefusedWithItsName) {
  const TemporaryFolder folder("rosbag2_other");
  const Rosbag2Form form{5, "sqlite3", "FILE"};
  std::string text = rosbag2_metadata_text(form, pushes(), {put_rosbag2_file(folder, form, pushes())});
  text.replace(text.find("zstd"), 4, "bz2");
  folder.put("metadata.yaml", text);
  try {
    read_bag(folder.path());
    FAIL() << "only zstd is read";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("metadata.yaml"), HasSubstr("'bz2'"), HasSubstr("ros2 bag convert")));
  }
}

/// Its player unpacks a file beside the packed one; its recorder names a file before it packs it.
TEST(Rosbag2, AFileThatLiesThereTwiceIsReadOnce) {
  for (const char* storage : {"mcap", "sqlite3"}) {
    const TemporaryFolder folder("rosbag2_twice");
    const std::string plain = put_rosbag2_file(folder, {9, storage, ""}, pushes());
    const std::string squeezed = put_rosbag2_file(folder, {9, storage, "FILE"}, pushes());
    expect_the_pushes(read_bag(folder.path()));
    for (const std::string& there : {plain, squeezed}) {
      for (const std::string& named : {plain, squeezed}) {
        const TemporaryFolder one("rosbag2_renamed");
        one.put(there, folder.get(there));
        one.put("metadata.yaml", rosbag2_metadata_text({9, storage, "FILE"}, pushes(), {named}));
        expect_the_pushes(read_bag(one.path()));
      }
    }
  }
}

TEST(Rosbag2, MetadataWithoutItsFilesSaysWhatIsMissing) {
  const TemporaryFolder folder("rosbag2_missing");
  folder.put("metadata.yaml", rosbag2_metadata_text({5, "mcap", ""}, pushes(), {"bag_0.mcap"}));
  try {
    read_bag(folder.path());
    FAIL() << "there is nothing to be read";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("metadata.yaml"), HasSubstr("names 'bag_0.mcap', which is not in this folder")));
  }
}

}  // namespace
}  // namespace palpate::io::rosbag2_test
