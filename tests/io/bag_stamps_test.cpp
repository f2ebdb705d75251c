// label: unit
// SPDX-License-Identifier: Apache-2.0
// Stamps that mean nothing: 0 before a simulation's clock is heard, and what damaged or restarted drivers send.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>

#include "io/made_up_recording.hpp"
#include "io/read_back.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::io::bag_stamps_test {
namespace {

using namespace palpate::io::test;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

constexpr std::int64_t epoch_ns = 1'700'000'000'000'000'000;

class BagStamps : public testing::Test {
 protected:
  void SetUp() override {
    write_bag(made_up(), folder.path() / "bag");
    text = folder.get("bag/mapping.yaml");
    bag = read_bag(folder.path() / "bag");
  }
  /// As a recorder logs a simulation: the headers count from the simulation's start.
  void log_at_epoch() {
    for (Message& one : bag.messages) one.log_time_ns += epoch_ns;
  }
  /// Sets the stamp of a topic's message of that number.
  void stamp(const std::string& topic, std::size_t number, std::int32_t seconds) {
    for (Message& one : bag.messages) {
      if (bag.topics[one.topic].name != topic || number-- > 0) continue;
      std::string& bytes = data.emplace_back(one.data);
      if (bag.topics[one.topic].type == "tf2_msgs/msg/TFMessage") {
        auto transforms = decode_transforms(one.data, topic);
        for (RosTransform& each : transforms) each.header.stamp_ns = seconds * std::int64_t{1'000'000'000};
        bytes = encode(transforms);
      } else {
        const std::int32_t parts[] = {seconds, 0};
        bytes.replace(4, 8, reinterpret_cast<const char*>(parts), 8);
      }
      one.data = bytes;
      return;
    }
    FAIL() << topic << " has no such message";
  }
  std::size_t count(const std::string& topic) const {
    std::size_t found = 0;
    for (const MessageTopic& one : bag.topics)
      if (one.name == topic) found = one.messages;
    return found;
  }
  SensorStreams streams_of(const std::string& more = {}) {
    folder.put("bag/changed.yaml", text + more);
    mapping = read_mapping(folder.path() / "bag/changed.yaml");
    return read_streams(bag, mapping);
  }
  double second_force_n() {
    const SensorStreams streams = streams_of();
    return acquisition::recording_from(mapping.plan, streams).recording.pushes.at(0).steps.at(1).loads.at(0).force_n->z();
  }

  TemporaryFolder folder{"bag_stamps"};
  MessageSource bag;
  BagMapping mapping;
  std::string text;
  std::deque<std::string> data;
};

/// What nodes send before /clock is heard.
TEST_F(BagStamps, AFirstForceWithoutAStampTellsNoClock) {
  log_at_epoch();
  stamp("/wrench", 0, 0);
  EXPECT_NEAR(second_force_n(), -1.7, 1e-12);
  const SensorStreams streams = streams_of();
  EXPECT_GT(streams.wrenches.front().time_s, -1);
  EXPECT_LT(streams.wrenches.back().time_s, streams.end_s + 1);
}

TEST_F(BagStamps, AFirstStampThatIsNonsenseTellsNoClock) {
  log_at_epoch();
  stamp("/wrench", 0, 2'147'000'000);
  EXPECT_NEAR(second_force_n(), -1.7, 0.02) << "one of the two samples of a step";
  EXPECT_THAT(streams_of().warnings, Contains(AllOf(HasSubstr("1 of 12 messages of /wrench"), HasSubstr("stamp"))));
}

/// One is enough: its time would be that of nothing else, and a search over all times would not end.
TEST_F(BagStamps, AStampFarFromTheBagIsLeftOutWithAWord) {
  for (const std::int32_t seconds : {-1'000'000'000, 1'500'000'000}) {
    bag = read_bag(folder.path() / "bag");
    stamp("/wrench", 5, seconds);
    stamp("/tf", 3, seconds);
    stamp("/camera/depth/image", 1, seconds);
    const SensorStreams streams = streams_of("clocks: {camera_offset_s: estimate, wrench_offset_s: estimate}\n");
    for (const char* topic : {"/wrench", "/tf", "/camera/depth/image"})
      EXPECT_THAT(streams.warnings, Contains(AllOf(HasSubstr(std::string(" messages of ") + topic + " were left out"),
                                                   HasSubstr("1 of "), HasSubstr("stamp: log"))));
    EXPECT_EQ(streams.wrenches.size(), 11u);
    for (const FrameLink& link : streams.frames)
      for (const PoseSample& one : link.samples) EXPECT_LT(std::abs(one.time_s), 1000) << link.child;
    for (const double time_s : streams.cameras.at(0).times_s) EXPECT_LT(std::abs(time_s), 1000);
    acquisition::recording_from(mapping.plan, streams);  // ends
  }
}

/// A clock of its own is stated in seconds, however many they are.
TEST_F(BagStamps, AGivenOffsetIsNoNonsense) {
  const std::size_t images = count("/camera/depth/image");
  for (std::size_t i = 0; i < images; ++i) stamp("/camera/depth/image", i, 5000);
  EXPECT_EQ(streams_of("clocks: {camera_offset_s: -5000}\n").cameras.at(0).times_s.size(), 1u) << "all at once: it is one";
}

TEST_F(BagStamps, ASensorOfAnotherClockIsRefusedWhereItIsMapped) {
  const std::size_t images = count("/camera/depth/image");
  for (std::size_t i = 0; i < images; ++i) stamp("/camera/depth/image", i, 1'500'000'000 + static_cast<std::int32_t>(i));
  try {
    streams_of();
    FAIL() << "no time of it is the bag's";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("changed.yaml:"), HasSubstr("topics.depth[0].image"), HasSubstr("'/camera/depth/image'"),
                                    HasSubstr("stamp: log")));
  }
}

/// What stands may have been said for the last time before the recorder was started.
TEST_F(BagStamps, WhatStandsWasSaidAtAnyTime) {
  RosTransform mount;
  mount.header = {-1'000'000'000'000'000'000, "tip"};
  mount.child = "sensor";
  bag.topics.push_back({"/tf_static", "tf2_msgs/msg/TFMessage", MessageEncoding::cdr, 1});
  data.push_back(encode(std::vector<RosTransform>{mount}));
  bag.messages.push_back({bag.topics.size() - 1, bag.messages.back().log_time_ns, data.back()});
  const SensorStreams streams = streams_of();
  EXPECT_THAT(streams.warnings, testing::IsEmpty());
  EXPECT_TRUE(std::any_of(streams.frames.begin(), streams.frames.end(),
                          [](const FrameLink& one) { return one.child == "sensor" && one.is_fixed && one.samples.size() == 1; }));
}

}  // namespace
}  // namespace palpate::io::bag_stamps_test
