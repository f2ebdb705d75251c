// label: unit
// SPDX-License-Identifier: Apache-2.0
// Clocks of force and camera against the arm's.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "acquisition/pressed_spring.hpp"

namespace palpate::acquisition {
namespace {

using namespace palpate::acquisition::test;
using testing::HasSubstr;

TEST(FromStreams, WhatEstimatedClocksLeaveIsStated) {
  StreamPlan aligned = plan();
  aligned.camera_clock.estimate = true;
  aligned.recording.time_offset_std_s = 0.003;
  const FromStreams made = recording_from(aligned, lab());
  ASSERT_EQ(made.clocks.size(), 1u);
  EXPECT_NEAR(made.recording.time_offset_std_s, std::hypot(0.003, made.clocks[0].std_s), 1e-12);
}

TEST(FromStreams, LateClocksAreFoundAndTakenOff) {
  for (const double late_s : {-0.21, 0.0, 0.13}) {
    LabOptions options;
    options.camera_late_s = late_s;
    options.wrench_late_s = -0.5 * late_s;
    StreamPlan aligned = plan();
    aligned.camera_clock.estimate = true;
    aligned.wrench_clock.estimate = true;
    const FromStreams made = recording_from(aligned, lab(options));
    ASSERT_EQ(made.clocks.size(), 2u);
    EXPECT_EQ(made.clocks[0].sensor, "force");
    EXPECT_TRUE(made.clocks[0].usable);
    EXPECT_NEAR(made.clocks[0].offset_s, 0.5 * late_s, 0.01) << "a bin is 20 ms, noise hides the ends of motions";
    EXPECT_TRUE(made.clocks[1].usable);
    EXPECT_NEAR(made.clocks[1].offset_s, -late_s, 0.02) << "an image is 33 ms";
    EXPECT_LT(std::abs(made.clocks[1].offset_s + late_s), 5 * made.clocks[1].std_s + 0.01);
  }
}

TEST(FromStreams, AClockThatCannotBeFoundIsLeftAlone) {
  SensorStreams streams = lab();
  streams.cameras[0].image = [](std::size_t) { return DepthImage(DepthImage::Constant(48, 64, 1.0f)); };
  StreamPlan aligned = plan();
  aligned.camera_clock.estimate = true;
  const FromStreams made = recording_from(aligned, streams);
  EXPECT_FALSE(made.clocks[0].usable);
  EXPECT_THAT(made.notes, testing::Contains(HasSubstr("could not be aligned")));
}

TEST(FromStreams, AClockThatCloudsCannotTellIsSaid) {
  SensorStreams streams = lab();
  CloudStream clouds;
  clouds.name = "/points";
  clouds.frame = "camera";
  clouds.sigma_m = 0.001;
  clouds.times_s = streams.cameras[0].times_s;
  clouds.cloud = [](std::size_t) {
    PointCloud cloud;
    cloud.points_m.setZero(1, 3);
    return cloud;
  };
  streams.cameras.clear();
  streams.clouds.push_back(clouds);
  StreamPlan late = plan();
  late.camera_clock.estimate = true;
  EXPECT_THAT(recording_from(late, streams).notes, testing::Contains(HasSubstr("there are clouds only")));
}

}  // namespace
}  // namespace palpate::acquisition
