// label: unit
// SPDX-License-Identifier: Apache-2.0
// A recording written as a bag comes back as it was; what other people's readers say of it is in rosbag2_peer_test.cpp.
#include "palpate/io/bag_write.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/made_up_recording.hpp"
#include "io/read_back.hpp"
#include "io/recording_folder.hpp"
#include "io/rosbag2_metadata.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::io::bag_write_test {
namespace {

using namespace palpate::io::test;

template <typename T>
const T* observation(const Step& step) {
  for (const Observation& one : step.observations)
    if (const T* found = std::get_if<T>(&one)) return found;
  return nullptr;
}

// Every push slipped before a step under load: what was seen is there, and can be read.
TEST(BagWrite, PushesThatNeverPressedComeBack) {
  const TemporaryFolder folder("bag_never_pressed");
  Recording recording = made_up();
  for (Push& push : recording.pushes) {
    std::erase_if(push.steps, [](const Step& step) { return !step.loads.empty(); });
    ASSERT_FALSE(push.steps.empty());
  }
  write_bag(recording, folder.path() / "bag");
  const Recording back = read_back(folder.path() / "bag");
  ASSERT_EQ(back.pushes.size(), recording.pushes.size());
  for (std::size_t p = 0; p < back.pushes.size(); ++p) {
    ASSERT_EQ(back.pushes[p].steps.size(), recording.pushes[p].steps.size());
    for (const Step& step : back.pushes[p].steps) EXPECT_TRUE(step.loads.empty());
  }
}

TEST(BagWrite, ComesBackAsItWas) {
  const TemporaryFolder folder("bag_write");
  const Recording recording = made_up();
  write_bag(recording, folder.path() / "bag");
  EXPECT_TRUE(is_bag(folder.path() / "bag"));
  const Recording back = read_back(folder.path() / "bag");
  EXPECT_EQ(back.rest.volume->nodes_m, recording.rest.volume->nodes_m);
  EXPECT_EQ(back.supports.size(), 1u);
  EXPECT_EQ(back.tools[0].radius_m, 0.02);
  EXPECT_EQ(back.force_scale_std, 0.01);
  ASSERT_EQ(back.pushes.size(), 2u);
  for (std::size_t p = 0; p < 2; ++p) {
    const Push &was = recording.pushes[p], &is = back.pushes[p];
    EXPECT_EQ(is.name, was.name);
    EXPECT_EQ(is.site, was.site);
    EXPECT_EQ(is.force_tare_std_n, was.force_tare_std_n);
    EXPECT_EQ(is.travel_offset_std_m, was.travel_offset_std_m);
    ASSERT_EQ(is.steps.size(), was.steps.size());
    for (std::size_t i = 0; i < is.steps.size(); ++i) {
      const Step &a = was.steps[i], &b = is.steps[i];
      EXPECT_EQ(b.unloading, a.unloading);
      EXPECT_EQ(b.slipped, a.slipped);
      EXPECT_NEAR(b.time_s - is.steps[0].time_s, a.time_s - was.steps[0].time_s, 1e-9);
      ASSERT_EQ(b.loads.size(), a.loads.size()) << p << " " << i;
      if (!a.loads.empty()) {
        EXPECT_LT((*b.loads[0].force_n - *a.loads[0].force_n).norm(), 1e-14);
        EXPECT_NEAR(b.loads[0].force_std_n, a.loads[0].force_std_n, 1e-14);
        EXPECT_EQ(b.loads[0].contact_m, a.loads[0].contact_m);
        EXPECT_EQ(b.loads[0].direction, a.loads[0].direction);
        EXPECT_EQ(b.loads[0].contact_std_m, a.loads[0].contact_std_m);
        EXPECT_NEAR(observation<ToolTravel>(b)->travel_m, observation<ToolTravel>(a)->travel_m, 1e-14);
        EXPECT_EQ(observation<ToolTravel>(b)->sigma_m, observation<ToolTravel>(a)->sigma_m);
      }
      if (const auto* cloud = observation<PointCloud>(a)) {
        ASSERT_NE(observation<PointCloud>(b), nullptr);
        EXPECT_EQ(observation<PointCloud>(b)->points_m, cloud->points_m);
        EXPECT_EQ(observation<PointCloud>(b)->sigma_m, cloud->sigma_m);
      }
      const DepthFrame &seen = *observation<DepthFrame>(a), &read = *observation<DepthFrame>(b);
      EXPECT_EQ(read.depth_m, seen.depth_m);
      EXPECT_EQ(read.mask, seen.mask);
      EXPECT_LT((read.T_base_camera.matrix() - seen.T_base_camera.matrix()).norm(), 1e-12);
      EXPECT_EQ(read.camera.fy_px, seen.camera.fy_px);
      EXPECT_EQ(read.noise, seen.noise);
      EXPECT_EQ(read.pose_std_m, seen.pose_std_m);
    }
  }
}

TEST(BagWrite, TheFolderIsWhatRosbag2Demands) {
  const TemporaryFolder folder("bag_metadata");
  write_bag(made_up(), folder.path() / "a bag: of #1");
  const Rosbag2Metadata about = rosbag2_metadata(folder.path() / "a bag: of #1");
  const MessageSource bag = read_bag(folder.path() / "a bag: of #1");
  EXPECT_TRUE(bag.warnings.empty()) << bag.warnings.front();
  EXPECT_EQ(about.storage, "mcap");
  EXPECT_EQ(about.messages, bag.messages.size());
  for (const MessageTopic& topic : bag.topics) EXPECT_EQ(about.topics.at(topic.name), topic.messages);
  ASSERT_EQ(about.files.size(), 1u);
  EXPECT_EQ(about.paths, std::vector<std::string>{about.files[0].path});
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "a bag: of #1" / about.paths[0]));
  EXPECT_EQ(about.files[0].messages, bag.messages.size());
  EXPECT_EQ(about.files[0].start_ns, bag.messages.front().log_time_ns);
  EXPECT_EQ(about.files[0].duration_ns, bag.messages.back().log_time_ns - bag.messages.front().log_time_ns);
}

TEST(BagWrite, APushThatTouchedNothingComesBackAsOne) {
  const TemporaryFolder folder("bag_write");
  Recording recording = made_up();
  for (Step& step : recording.pushes[1].steps) {
    step.loads.clear();
    std::erase_if(step.observations, [](const Observation& one) { return std::holds_alternative<ToolTravel>(one); });
  }
  write_bag(recording, folder.path() / "bag");
  const Recording back = read_back(folder.path() / "bag");
  ASSERT_EQ(back.pushes.size(), 2u);
  ASSERT_EQ(back.pushes[1].steps.size(), recording.pushes[1].steps.size());
  for (const Step& step : back.pushes[1].steps) {
    EXPECT_TRUE(step.loads.empty());
    EXPECT_NE(observation<DepthFrame>(step), nullptr);
  }
}

/// A fit takes the way of a direction, whatever its length.
TEST(BagWrite, DirectionsAreOfUnitLength) {
  const TemporaryFolder folder("bag_directions");
  Recording recording = made_up();
  for (Step& step : recording.pushes[0].steps) {
    step.T_base_tip.reset();  // the tip then stands where the travel says
    for (Load& load : step.loads) load.direction *= 2;
  }
  write_bag(recording, folder.path() / "bag");
  const Recording back = read_back(folder.path() / "bag");
  for (std::size_t i = 1; i < recording.pushes[0].steps.size(); ++i) {
    const Step &a = recording.pushes[0].steps[i], &b = back.pushes[0].steps[i];
    EXPECT_EQ(b.loads.at(0).direction, Vec3(0, 0, -1));
    ASSERT_NE(observation<ToolTravel>(b), nullptr);
    EXPECT_NEAR(observation<ToolTravel>(b)->travel_m, observation<ToolTravel>(a)->travel_m, 1e-14);
  }
}

TEST(BagWrite, WhatNoReaderTakesIsRefused) {
  const TemporaryFolder folder("bag_unreadable");
  const auto said = [&](const Recording& recording) -> std::string {
    try {
      write_bag(recording, folder.path() / "bag");
    } catch (const Error& error) {
      return error.what();
    }
    return "was written";
  };
  Recording timeless = made_up();
  for (Step& step : timeless.pushes[0].steps) step.time_s = 0;
  EXPECT_THAT(said(timeless), testing::HasSubstr("time_s: does not follow the step before in time"));
  Recording noiseless = made_up();
  for (Observation& one : noiseless.pushes[1].steps[1].observations)
    if (auto* frame = std::get_if<DepthFrame>(&one)) frame->noise = {};
  EXPECT_THAT(said(noiseless), testing::HasSubstr("noise.sigma_m: is not given"));
}

TEST(BagWrite, WhatATopicCannotSayIsRefused) {
  const TemporaryFolder folder("bag_refused");
  Recording imposed = made_up();
  imposed.pushes[0].steps[1].loads[0].force_n.reset();
  imposed.pushes[0].steps[1].loads[0].travel_m = 0.01;
  EXPECT_THROW(write_bag(imposed, folder.path() / "a"), Error);
  Recording wrench = made_up();
  wrench.pushes[0].steps[1].observations.emplace_back(Wrench{});
  EXPECT_THROW(write_bag(wrench, folder.path() / "b"), Error);
  folder.put("c/something", "x");
  EXPECT_THROW(write_bag(made_up(), folder.path() / "c"), Error);
}

}  // namespace
}  // namespace palpate::io::bag_write_test
