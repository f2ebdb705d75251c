// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/from_streams.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "acquisition/pressed_spring.hpp"
#include "palpate/acquisition/find_pushes.hpp"
#include "palpate/acquisition/repeated_notes.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition::from_streams_test {
namespace {

using namespace palpate::acquisition::test;
using testing::HasSubstr;

TEST(FromStreams, FindsThePushItsStepsAndItsUnloading) {
  const FromStreams made = recording_from(stream_plan(), lab());
  ASSERT_EQ(made.recording.pushes.size(), 1u);
  const Push& push = made.recording.pushes[0];
  // Before, four stages down, one up, after.
  ASSERT_EQ(push.steps.size(), 7u);
  EXPECT_TRUE(push.steps.front().loads.empty());
  EXPECT_FALSE(push.steps.front().unloading);
  EXPECT_TRUE(push.steps.back().loads.empty());
  EXPECT_TRUE(push.steps.back().unloading);
  const double expected_n[] = {2, 4, 6, 8, 4};
  for (std::size_t i = 0; i < 5; ++i) {
    const Step& step = push.steps[i + 1];
    ASSERT_EQ(step.loads.size(), 1u);
    const Load& load = step.loads[0];
    // The mean of 100 samples of 0.02 N against a tare of 200: five standard deviations.
    EXPECT_LT((*load.force_n - Vec3(0, 0, -expected_n[i])).norm(), 5 * 0.02 * std::sqrt(3 * (1 / 100. + 1 / 200.))) << i;
    EXPECT_NEAR(load.force_std_n, 0.02 / 10, 0.0008);
    EXPECT_NEAR(load.contact_m.z(), top_m, 0.0001) << "noticed at 0.3 N, 0.75 mm later, and traced back";
    EXPECT_LT((load.direction - Vec3(0, 0, -1)).norm(), 1e-9);
    EXPECT_NEAR(travel_of(step), expected_n[i] / stiffness_n_m, 0.0001);
    EXPECT_EQ(step.unloading, i == 4);
    EXPECT_EQ(load.tool, "stick");
    bool seen = false;
    for (const Observation& one : step.observations) {
      const auto* frame = std::get_if<DepthFrame>(&one);
      if (frame == nullptr) continue;
      seen = true;
      EXPECT_LT(std::abs(frame->time_s - step.time_s), 0.02);
      EXPECT_EQ(frame->depth_m, picture(frame->time_s));
    }
    EXPECT_TRUE(seen);
  }
  EXPECT_NEAR(push.force_tare_std_n, 0.02 / std::sqrt(200.0), 0.0005);
}

// 20 mN a second while the tool goes in and back: the free air after the push says so.
TEST(FromStreams, ADriftBetweenTheFreeAirBeforeAndAfterIsTakenOff) {
  LabOptions drifts;
  drifts.drift_n_s = Vec3(0.01, -0.02, 0.01);
  const Push still = recording_from(stream_plan(), lab()).recording.pushes.at(0), made = recording_from(stream_plan(), lab(drifts)).recording.pushes.at(0);
  ASSERT_EQ(made.steps.size(), still.steps.size());
  for (std::size_t i = 1; i + 1 < made.steps.size(); ++i)
    EXPECT_LT((*made.steps[i].loads.at(0).force_n - *still.steps[i].loads.at(0).force_n).norm(), 0.012) << "a sample's worth of tare's noise";
  const double duration_s = made.steps[made.steps.size() - 2].time_s - made.steps[0].time_s;
  EXPECT_GT(duration_s * drifts.drift_n_s.norm(), 0.2) << "what would be left of it without";

  LabOptions much = drifts;
  much.drift_n_s *= 5;
  EXPECT_THAT(recording_from(stream_plan(), lab(much)).notes, testing::Contains(HasSubstr("the zero of the force moved by")));
  StreamPlan kept = stream_plan();
  kept.tare = Tare::between;
  kept.tare_to_s = 2;
  const Push by_hand = recording_from(kept, lab(drifts)).recording.pushes.at(0);
  EXPECT_GT((*by_hand.steps[4].loads.at(0).force_n - *still.steps[4].loads.at(0).force_n).norm(), 0.1) << "as it was asked for";
}

TEST(FromStreams, AForceOnTheObjectKeepsItsSign) {
  SensorStreams streams = lab();
  for (WrenchSample& one : streams.wrenches) one.force_n = -one.force_n;
  StreamPlan on_object = stream_plan();
  on_object.force_on_object = true;
  EXPECT_NEAR(recording_from(on_object, streams).recording.pushes[0].steps[4].loads[0].force_n->z(), -8, 0.02);
  StreamPlan wrong = stream_plan();
  try {
    recording_from(wrong, streams);
    FAIL() << "a force of the wrong sign is no contact";
  } catch (const Error& error) {
    EXPECT_THAT(error.message(), HasSubstr("sign"));
  }
}

TEST(FromStreams, TimesAndMarksChooseTheSteps) {
  StreamPlan times = stream_plan();
  times.steps_by = StepsBy::times;
  PlannedPush push = times.any_push;
  push.name = "head";
  push.site = "head";
  push.at_s = {3, 7.5, 15.5, 23.5};
  times.pushes = {push};
  const FromStreams made = recording_from(times, lab());
  ASSERT_EQ(made.recording.pushes.size(), 1u);
  const auto& steps = made.recording.pushes[0].steps;
  ASSERT_EQ(steps.size(), 4u);
  EXPECT_TRUE(steps[0].loads.empty()) << "in free air";
  EXPECT_NEAR(steps[2].loads[0].force_n->z(), -6, 0.02);
  EXPECT_TRUE(steps[3].unloading);
  EXPECT_EQ(made.recording.pushes[0].site, "head");

  StreamPlan marks = stream_plan();
  marks.steps_by = StepsBy::marks;
  marks.pushes = {push};
  SensorStreams streams = lab();
  streams.marks = {{3, "head; unloaded"}, {7.5, "head"}, {15.5, "head; unloading"}};
  const auto marked = recording_from(marks, streams).recording.pushes;
  ASSERT_EQ(marked.size(), 1u);
  EXPECT_EQ(marked[0].site, "head");
  EXPECT_TRUE(marked[0].steps[0].loads.empty());
  EXPECT_TRUE(marked[0].steps[2].unloading) << "the mark says so";
}

TEST(FromStreams, PushesAndContactsThatAreNotAsManyAreSaid) {
  StreamPlan described = stream_plan();
  described.pushes = {described.any_push};
  described.pushes[0].name = "head";
  EXPECT_TRUE(recording_from(described, lab()).notes.empty());
  described.pushes.push_back(described.any_push);
  described.pushes[1].name = "foot";
  const FromStreams made = recording_from(described, lab());
  EXPECT_EQ(made.recording.pushes.at(0).name, "head");
  EXPECT_THAT(made.notes, testing::Contains(testing::AllOf(HasSubstr("pushes in steps.pushes: 2, contacts found in the force: 1"),
                                                           HasSubstr("the last pushes have no contact"))));
}

TEST(FromStreams, AForceOnItsWayIsThatOfTheImage) {
  StreamPlan moving = stream_plan();
  moving.steps_by = StepsBy::times;
  moving.pushes = {moving.any_push};
  moving.pushes[0].name = "away";
  moving.pushes[0].at_s = {23.5, 24.79};  // standing; going back at 10 mm/s, the image is of 24.8 s
  const FromStreams made = recording_from(moving, lab());
  const auto& steps = made.recording.pushes.at(0).steps;
  ASSERT_EQ(steps.size(), 2u);
  EXPECT_TRUE(steps[0].loads.at(0).force_rate_n_s.isZero(0));
  const Load& load = steps[1].loads.at(0);
  EXPECT_NEAR(load.force_n->z(), -force_n(24.8), 0.02) << "the mean over half a second is a newton more";
  EXPECT_NEAR(load.force_rate_n_s.z(), 4, 0.1);
  EXPECT_LT(load.force_rate_n_s.head<2>().norm(), 0.1);
  EXPECT_GT(load.force_std_n, 1e-3);
  EXPECT_LT(load.force_std_n, 0.01) << "of a line through a hundred samples of 0.02 N, at its end";
  EXPECT_NEAR(travel_of(steps[0]) - travel_of(steps[1]), height_m(24.8) - height_m(23.5), 1e-4);
  EXPECT_THAT(made.notes, testing::Contains(HasSubstr("the force was changing in 1 step, the first at 24.790 s")));
}

TEST(FromStreams, ATareWhereNothingWasMeasuredIsRefused) {
  StreamPlan wrong = stream_plan();
  wrong.tare = Tare::between;
  wrong.tare_from_s = 1000;
  wrong.tare_to_s = 1001;
  try {
    recording_from(wrong, lab());
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("wrench.tare"), HasSubstr("no force was measured"), HasSubstr("29.99")));
  }
}

/// The same sensor with its sign turned by its driver, a tool of 2 kg on it: either report gives the force on the object.
TEST(FromStreams, TheToolsWeightIsTakenOffWhateverTheSensorReports) {
  LabOptions quiet;
  quiet.bias_n.setZero();
  SensorStreams streams = lab(quiet);
  const Vec3 weight(0, 0, -2 * 9.81);
  const Mat3 R_tip_sensor = streams.frames[1].samples[0].T_parent_child.linear();
  for (WrenchSample& sample : streams.wrenches) sample.force_n += (tip_at(sample.time_s).linear() * R_tip_sensor).transpose() * weight;
  StreamPlan heavy = stream_plan();
  heavy.tare = Tare::none;
  heavy.tool_mass_kg = 2;
  const auto on_sensor = recording_from(heavy, streams).recording.pushes.at(0);
  for (WrenchSample& sample : streams.wrenches) sample.force_n *= -1;
  heavy.force_on_object = true;
  const auto on_object = recording_from(heavy, streams).recording.pushes.at(0);
  ASSERT_EQ(on_sensor.steps.size(), on_object.steps.size());
  for (std::size_t i = 1; i + 1 < on_object.steps.size(); ++i) {
    const Vec3 force = *on_object.steps[i].loads.at(0).force_n;
    EXPECT_LT((force - *on_sensor.steps[i].loads.at(0).force_n).norm(), 1e-9);
    EXPECT_NEAR(force.z(), -force_n(on_object.steps[i].time_s), 0.05);
  }
}

TEST(FromStreams, CloudsComeIntoTheBaseFrame) {
  SensorStreams streams = lab();
  Pose pose = Pose::Identity();
  pose.rotate(Eigen::AngleAxisd(0.4, Vec3::UnitY()));
  pose.pretranslate(Vec3(0, 0, 1));
  streams.frames[2].samples[0].T_parent_child = pose;
  CloudStream clouds;
  clouds.name = "/points";
  clouds.frame = "camera";
  clouds.sigma_m = 0.001;
  for (int i = 0; i < 300; ++i) clouds.times_s.push_back(0.1 * i);
  clouds.cloud = [](std::size_t i) {
    PointCloud cloud;
    cloud.points_m.resize(2, 3);
    cloud.points_m << 0.1 * static_cast<double>(i), 0, 0, 0, 0.2, 0.3;
    return cloud;
  };
  streams.clouds.push_back(clouds);
  const auto steps = recording_from(stream_plan(), streams).recording.pushes.at(0).steps;
  std::size_t seen = 0;
  for (const Step& step : steps) {
    for (const Observation& one : step.observations) {
      const auto* cloud = std::get_if<PointCloud>(&one);
      if (cloud == nullptr) continue;
      ++seen;
      EXPECT_LT((Vec3(cloud->points_m.row(1)) - pose * Vec3(0, 0.2, 0.3)).norm(), 1e-12);
      const double i = (pose.inverse() * Vec3(cloud->points_m.row(0))).x() / 0.1;
      EXPECT_NEAR(0.1 * i, step.time_s, 0.051) << "the cloud nearest in time";
      EXPECT_EQ(cloud->sigma_m[0], 0.001);
    }
  }
  EXPECT_EQ(seen, steps.size());
}

TEST(FromStreams, WhatIsMissingIsSaidWithACure) {
  const auto message = [](const StreamPlan& asked, const SensorStreams& streams) -> std::string {
    try {
      recording_from(asked, streams);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing";
  };
  StreamPlan other = stream_plan();
  other.tip_frame = "flange";
  EXPECT_THAT(message(other, lab()), testing::AllOf(HasSubstr("'flange'"), HasSubstr("base, camera, sensor, tip")));
  SensorStreams moving = lab();
  StreamPlan patient = stream_plan();
  patient.hold_s = 5;
  EXPECT_THAT(message(patient, moving), HasSubstr("stood still"));
  moving.cameras[0].image = [](std::size_t) -> DepthImage { throw Error("is damaged", "m"); };
  const FromStreams made = recording_from(stream_plan(), moving);
  EXPECT_THAT(made.notes, testing::Contains(HasSubstr("is damaged")));
  EXPECT_EQ(made.recording.pushes[0].steps.size(), 7u) << "the steps have their force and travel still";
}

TEST(FromStreams, StepsWithoutAnImageAreSaidOnceWithTheWorst) {
  SensorStreams streams = lab();
  const std::size_t steps = recording_from(stream_plan(), streams).recording.pushes.at(0).steps.size();
  DepthStream& camera = streams.cameras[0];
  camera.times_s = {camera.times_s.back() + 100};
  const FromStreams made = recording_from(stream_plan(), streams);
  const std::vector<Step>& all = made.recording.pushes.at(0).steps;
  ASSERT_EQ(all.size(), steps);
  EXPECT_THAT(made.notes, testing::ElementsAre(testing::AllOf(
                              HasSubstr("no image within 0.500 s of " + std::to_string(steps) + " steps, the first at " +
                                        seconds_text(all.front().time_s) + "; at " + seconds_text(all.front().time_s)),
                              HasSubstr("furthest, " + seconds_text(camera.times_s[0] - all.front().time_s) + " away"))));
}

/// A camera that takes one picture a step: the object at rest is seen seconds before the touch and after the retreat.
TEST(FromStreams, AStepWithoutALoadIsWhereThePictureIs) {
  SensorStreams streams = lab();
  streams.cameras[0].times_s = {1.5, 2.6, 7.9, 11.9, 15.9, 19.9, 23.9, 29.2};
  streams.cameras[0].image = [times = streams.cameras[0].times_s](std::size_t i) { return picture(times[i]); };
  const FromStreams made = recording_from(stream_plan(), streams);
  EXPECT_TRUE(made.notes.empty()) << made.notes.front();
  const std::vector<Step>& steps = made.recording.pushes.at(0).steps;
  ASSERT_EQ(steps.size(), 7u);
  const double expected_s[] = {2.6, 7.9, 11.9, 15.9, 19.9, 23.9, 29.2};
  for (std::size_t i = 0; i < 7; ++i) {
    ASSERT_EQ(steps[i].observations.empty(), false) << i;
    const auto* frame = std::get_if<DepthFrame>(&steps[i].observations.back());
    ASSERT_NE(frame, nullptr) << i;
    EXPECT_EQ(frame->time_s, expected_s[i]);
    EXPECT_EQ(steps[i].loads.empty(), i == 0 || i == 6);
  }
  // A picture while it still touches, or is hardly off it, is none of the object at rest.
  streams.cameras[0].times_s.back() = 24.99;
  EXPECT_THAT(recording_from(stream_plan(), streams).notes, testing::Contains(HasSubstr("no image within")));
}

TEST(FindContacts, ADriftingBiasIsTaredAnewForEachPush) {
  Track track;
  for (int i = 0; i < 6000; ++i) {
    const double time = 0.01 * i;
    const double pressing = (time > 10 && time < 15) || (time > 40 && time < 45) ? 5 : 0;
    const double depth = pressing > 0 ? std::min(0.01 * (time < 30 ? time - 10 : time - 40), 0.02) : 0;
    track.samples.push_back({time, Vec3(0.02 * time, 0, -pressing - 0.01 * time), Vec3(0, 0, -depth)});
    track.direction.push_back(-Vec3::UnitZ());
  }
  const auto spans = find_contacts(track, stream_plan());
  ASSERT_EQ(spans.size(), 2u);
  EXPECT_NEAR(spans[0].tare_n.z(), -0.01 * 9.4, 0.005);
  EXPECT_NEAR(spans[1].tare_n.z(), -0.01 * 39.4, 0.005);
  EXPECT_NEAR(track.samples[spans[1].begin].time_s, 40, 0.05);
}

/// An arm that comes down at 5 mm/s and stands every 10 mm, on objects so soft that the force takes up to two seconds to reach
/// the threshold of contact: what rises before that is no free air.
TEST(FindContacts, ASlowRiseIsNotTakenForFreeAir) {
  constexpr double noise_n = 0.055, period_s = 1 / 35.0, speed_m_s = 0.005, contact_s = 5, bias_n = 3.4;
  for (const double rate_n_s : {0.2, 0.4, 0.8, 1.6, 5.0}) {
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    Track track;
    const auto depth_m = [&](double time) {  // down for 12 s, standing 2 s of every 4, and up again
      const double gone = std::min(time, 24 - time), whole = std::floor(gone / 4);
      return speed_m_s * (2 * whole + std::min(2.0, gone - 4 * whole));
    };
    const double touching_m = depth_m(contact_s), stiffness = rate_n_s / speed_m_s;
    for (double time = 0; time < 24; time += period_s) {
      const double pressing = stiffness * std::max(0.0, depth_m(time) - touching_m);
      const Vec3 noise(normal(random), normal(random), normal(random));
      track.samples.push_back({time, Vec3(-0.3, -0.7, bias_n - pressing) + noise_n * noise, Vec3(0, 0, -depth_m(time))});
      track.direction.push_back(-Vec3::UnitZ());
    }
    const auto spans = find_contacts(track, stream_plan());
    ASSERT_EQ(spans.size(), 1u) << rate_n_s;
    EXPECT_NEAR(spans[0].tare_n.z(), bias_n, 0.04) << rate_n_s << ": 35 samples of 0.055 N";
    EXPECT_LT(spans[0].free_air_std_n, 1.5 * noise_n) << rate_n_s;
    EXPECT_LT(stiffness * (-spans[0].contact_m.z() - touching_m), 0.3 + 3 * noise_n) << rate_n_s << ": the threshold and some noise";
  }
}

/// A cable that pulls a little more from one moment on, while the tool comes down in free air: back or aside, it is forgotten.
TEST(FindContacts, AnOnsetThatWasNoneIsForgottenWhereTheToolWentElsewhere) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  Track track;
  for (double time = 0; time < 30; time += 0.02) {
    const double pulls = time > 5 ? 0.15 : 0, aside_m = 0.02 * std::clamp(time - 10, 0.0, 3.0);
    const double lowered_m = 0.002 * std::min(time, 8.0), depth_m = 0.01 * std::clamp(time - 20, 0.0, 2.0);
    track.samples.push_back({time, Vec3(0, 0, -pulls - 400 * depth_m) + 0.02 * Vec3(normal(random), normal(random), normal(random)),
                             Vec3(aside_m, 0, -lowered_m - depth_m)});
    track.direction.push_back(-Vec3::UnitZ());
  }
  const auto spans = find_contacts(track, stream_plan());
  ASSERT_EQ(spans.size(), 1u);
  EXPECT_NEAR(track.samples[spans[0].begin].time_s, 20, 0.2);
  EXPECT_NEAR(spans[0].tare_n.z(), -0.15, 0.01);
}

}  // namespace
}  // namespace palpate::acquisition::from_streams_test
