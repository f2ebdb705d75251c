// label: unit
// SPDX-License-Identifier: Apache-2.0
// Clocks of force and camera against the arm's.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "acquisition/pressed_spring.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition::stream_clocks_test {
namespace {

using namespace palpate::acquisition::test;
using testing::HasSubstr;

TEST(FromStreams, WhatEstimatedClocksLeaveIsStated) {
  StreamPlan aligned = stream_plan();
  aligned.camera_clock.estimate = true;
  aligned.recording.time_offset_std_s = 0.003;
  const FromStreams made = recording_from(aligned, lab());
  ASSERT_EQ(made.clocks.size(), 1u);
  EXPECT_NEAR(made.recording.time_offset_std_s, std::hypot(0.003, left_std_s(made.clocks[0])), 1e-12);
}

TEST(FromStreams, LateClocksAreFoundAndTakenOff) {
  for (const double late_s : {-0.21, 0.0, 0.13}) {
    LabOptions options;
    options.camera_late_s = late_s;
    options.wrench_late_s = -0.5 * late_s;
    StreamPlan aligned = stream_plan();
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

/// One standard deviation from zero is no evidence; what is not taken off is stated with the rest.
TEST(ClockOffset, WhatIsNoEvidenceIsNotTakenOff) {
  const auto of = [](double offset_s, double std_s) {
    ClockOffset found;
    found.offset_s = offset_s, found.std_s = std_s, found.usable = true;
    return found;
  };
  EXPECT_EQ(believed_offset_s(of(0.0459, 0.0522)), 0);
  EXPECT_NEAR(left_std_s(of(0.0459, 0.0522)), std::hypot(0.0459, 0.0522), 1e-12);
  EXPECT_NEAR(believed_offset_s(of(-0.2, 0.005)), -0.2, 2e-4);
  EXPECT_NEAR(left_std_s(of(-0.2, 0.005)), 0.005, 1e-5);
  EXPECT_NEAR(believed_offset_s(of(0.05001, 0.05)), 0, 1e-4) << "no jump where it begins to count";
  ClockOffset unusable = of(0.3, 0.001);
  unusable.usable = false;
  EXPECT_EQ(believed_offset_s(unusable), 0);
  EXPECT_EQ(left_std_s(unusable), 0);
}

/// Over offsets of any size: what is stated is how far the clocks are apart in the end.
TEST(ClockOffset, WhatIsLeftIsAsLargeAsItIsStated) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  constexpr double std_s = 0.02;
  for (const double true_s : {0.0, 0.01, 0.02, 0.04, 0.1}) {
    double missed = 0, stated = 0;
    for (int i = 0; i < 4000; ++i) {
      ClockOffset found;
      found.offset_s = true_s + std_s * normal(random), found.std_s = std_s, found.usable = true;
      missed += std::pow(believed_offset_s(found) - true_s, 2);
      stated += std::pow(left_std_s(found), 2);
    }
    EXPECT_LT(std::sqrt(missed / stated), 1.1) << true_s;
    EXPECT_GT(std::sqrt(missed / stated), 0.4) << true_s;
  }
}

/// An image every few seconds, as a protocol takes them while the tool stands: any offset goes nearly as well with what they show, and
/// the highest peak is one of many.
TEST(ClockOffset, FewImagesDoNotTellAnOffset) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  int usable = 0, missed = 0;
  for (int trial = 0; trial < 300; ++trial) {
    RunningSum motion;
    std::vector<Change> changes;
    double way = 0;
    for (double time = 0; time < 60; time += 4) {  // moves for half a second to a second, and stands
      motion.times_s.insert(motion.times_s.end(), {time + 0.01, time + 0.5 + 0.5 * uniform(random)});
      motion.values.push_back(way);
      motion.values.push_back(way += 0.002 + 0.003 * uniform(random));
    }
    std::vector<double> images_s;
    for (double time = 0.5; time < 60; time += 4) images_s.push_back(time + 3 * uniform(random));
    for (std::size_t i = 1; i < images_s.size(); ++i)
      changes.push_back({images_s[i - 1], images_s[i],
                         motion.at(images_s[i]) - motion.at(images_s[i - 1]) + 0.0007 * normal(random)});
    const ClockOffset found = find_offset(motion, changes, 0.5);
    usable += found.usable ? 1 : 0;
    missed += found.usable && std::abs(found.offset_s) > 3 * found.std_s ? 1 : 0;
  }
  EXPECT_LE(missed, 0.02 * usable + 1) << "of " << usable << " usable ones, true offset zero";
}

TEST(ClockOffset, ASearchWithoutEndIsRefused) {
  const RunningSum motion{{0, 1}, {0, 1}};
  const std::vector<Change> changes(20, Change{0, 1, 1});
  for (const double largest_s : {1e6, 1e9, 1e300}) {
    try {
      find_offset(motion, changes, largest_s);
      FAIL() << largest_s;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("largest_s"));
    }
  }
}

TEST(FromStreams, GivenOffsetsAreAddedToTheSensorsTimes) {
  LabOptions late;
  late.camera_late_s = 0.13;
  late.wrench_late_s = -0.21;
  StreamPlan given = stream_plan();
  given.camera_clock.offset_s = -0.13;
  given.wrench_clock.offset_s = 0.21;
  const FromStreams made = recording_from(given, lab(late)), expected = recording_from(stream_plan(), lab());
  EXPECT_TRUE(made.clocks.empty());
  EXPECT_EQ(made.recording.time_offset_std_s, 0) << "a number is taken as known";
  const auto &is = made.recording.pushes.at(0).steps, &was = expected.recording.pushes.at(0).steps;
  ASSERT_EQ(is.size(), was.size());
  for (std::size_t i = 1; i + 1 < is.size(); ++i) {
    EXPECT_NEAR(is[i].time_s, was[i].time_s, 0.006);
    EXPECT_LT((*is[i].loads.at(0).force_n - *was[i].loads.at(0).force_n).norm(), 0.01);
    for (const Observation& one : is[i].observations)
      if (const auto* frame = std::get_if<DepthFrame>(&one)) {
        EXPECT_EQ(frame->depth_m, picture(frame->time_s)) << i;
      }
  }
}

TEST(FromStreams, AClockThatCannotBeFoundIsLeftAlone) {
  SensorStreams streams = lab();
  streams.cameras[0].image = [](std::size_t) { return DepthImage(DepthImage::Constant(48, 64, 1.0f)); };
  StreamPlan aligned = stream_plan();
  aligned.camera_clock.estimate = true;
  const FromStreams made = recording_from(aligned, streams);
  EXPECT_FALSE(made.clocks[0].usable);
  EXPECT_THAT(made.notes, testing::Contains(HasSubstr("could not be aligned")));
}

/// A time that belongs to nothing else is no stretch to search: the arm's own times are.
TEST(FromStreams, OneForceOfAnotherCenturyDoesNotHoldUpTheSearch) {
  LabOptions late;
  late.camera_late_s = 0.13;
  SensorStreams streams = lab(late);
  streams.wrenches.insert(streams.wrenches.begin(), {-1.7e9, Vec3::Zero(), Vec3::Zero()});
  StreamPlan aligned = stream_plan();
  aligned.camera_clock.estimate = true;
  aligned.wrench_clock.estimate = true;
  const FromStreams made = recording_from(aligned, streams);
  ASSERT_EQ(made.clocks.size(), 2u);
  EXPECT_NEAR(made.clocks[0].offset_s, 0, 0.01);
  EXPECT_NEAR(made.clocks[1].offset_s, -0.13, 0.02);
}

TEST(FromStreams, ACameraWithoutAnImageTellsNoClock) {
  SensorStreams streams = lab();
  streams.cameras[0].times_s.clear();
  StreamPlan aligned = stream_plan();
  aligned.camera_clock.estimate = true;
  const FromStreams made = recording_from(aligned, streams);
  ASSERT_EQ(made.clocks.size(), 1u);
  EXPECT_FALSE(made.clocks[0].usable);
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
  StreamPlan late = stream_plan();
  late.camera_clock.estimate = true;
  EXPECT_THAT(recording_from(late, streams).notes, testing::Contains(HasSubstr("there are clouds only")));
}

}  // namespace
}  // namespace palpate::acquisition::stream_clocks_test
