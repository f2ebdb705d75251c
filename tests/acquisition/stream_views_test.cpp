// label: unit
// SPDX-License-Identifier: Apache-2.0
// Images and clouds of streams: what a step and the object at rest are shown by, and what is not worth keeping.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "acquisition/pressed_spring.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition::stream_views_test {
namespace {

using namespace palpate::acquisition::test;
using testing::Contains;
using testing::HasSubstr;

std::vector<DepthFrame> images_of(const FromStreams& made) {
  std::vector<DepthFrame> images;
  for (const Push& push : made.recording.pushes)
    for (const Step& step : push.steps)
      for (const Observation& one : step.observations)
        if (const auto* frame = std::get_if<DepthFrame>(&one)) images.push_back(*frame);
  return images;
}

/// A tool of a box on a column whose joint nobody tells of.
RobotModel column() {
  RobotModel robot;
  robot.name = "column";
  RobotShape box;
  box.kind = RobotShape::Kind::box;
  box.size_m = Vec3(0.02, 0.02, 0.02);
  robot.links = {{"foot", {}, {}}, {"carriage", {box}, {}}};
  RobotJoint lift;
  lift.kind = RobotJoint::Kind::prismatic;
  lift.name = "lift";
  lift.parent = "foot";
  lift.child = "carriage";
  lift.axis = Vec3::UnitZ();
  lift.lower = -1, lift.upper = 1;
  robot.joints = {lift};
  return robot;
}

// Such an image was called masked, and the stick in it was taken for the object.
TEST(StreamViews, ARobotThatCannotBePlacedLeavesItsStickToBeMasked) {
  SensorStreams streams = lab();
  StreamPlan described = stream_plan();
  described.recording.robot = column();
  for (const DepthFrame& image : images_of(recording_from(described, streams))) EXPECT_FALSE(image.robot_is_masked) << "no joint states";

  streams.joint_names = {"lift"};
  for (const PoseSample& sample : streams.frames[0].samples) streams.joints.push_back({sample.time_s, {height_m(sample.time_s)}});
  const FromStreams unplaced = recording_from(described, streams);
  EXPECT_THAT(unplaced.notes, Contains(HasSubstr("the pose of 'foot' is not known")));
  for (const Step& step : unplaced.recording.pushes.at(0).steps) EXPECT_TRUE(step.joints_rad.empty()) << "else it is masked as if it stood at the base";
  for (const DepthFrame& image : images_of(unplaced)) EXPECT_FALSE(image.robot_is_masked);

  streams.cameras[0].mask_robot = false;
  for (const DepthFrame& image : images_of(recording_from(described, streams))) EXPECT_TRUE(image.robot_is_masked) << "nothing is to be masked";
  streams.cameras[0].mask_robot.reset();
  described.recording.robot->links[1].visual.clear();
  const FromStreams shapeless = recording_from(described, streams);
  for (const DepthFrame& image : images_of(shapeless)) EXPECT_FALSE(image.robot_is_masked) << "meshes that were not found";
  EXPECT_FALSE(shapeless.recording.pushes.at(0).steps.at(0).joints_rad.empty()) << "they still say how the arm stood";
}

// One such image made the whole recording unusable.
TEST(StreamViews, AnImageThatShowsNothingIsLeftOut) {
  SensorStreams streams = lab();
  const auto all = images_of(recording_from(stream_plan(), streams));
  streams.cameras[0].image = [times = streams.cameras[0].times_s](std::size_t i) {
    return times[i] > 10 && times[i] < 14 ? DepthImage(DepthImage::Zero(48, 64)) : picture(times[i]);
  };
  const FromStreams made = recording_from(stream_plan(), streams);
  EXPECT_EQ(images_of(made).size(), all.size() - 1);
  EXPECT_EQ(made.recording.pushes.at(0).steps.size(), recording_from(stream_plan(), lab()).recording.pushes.at(0).steps.size()) << "its force counts all the same";
  EXPECT_THAT(made.notes, Contains(HasSubstr("/depth: the image shows nothing outside its mask at the step at")));
  streams.cameras[0].mask = [](std::size_t) { return MaskImage(MaskImage::Ones(48, 64)); };
  EXPECT_TRUE(images_of(recording_from(stream_plan(), streams)).empty());
}

TEST(StreamViews, ACloudWithoutAPointIsLeftOut) {
  SensorStreams streams = lab();
  CloudStream clouds;
  clouds.name = "/points";
  clouds.frame = "base";
  clouds.sigma_m = 0.001;
  for (int i = 0; i < 300; ++i) clouds.times_s.push_back(0.1 * i);
  clouds.cloud = [](std::size_t i) {
    PointCloud cloud;
    cloud.points_m.resize(i > 100 && i < 140 ? 0 : 2, 3);
    cloud.points_m.setConstant(0.1);
    return cloud;
  };
  streams.clouds.push_back(clouds);
  const FromStreams made = recording_from(stream_plan(), streams);
  std::size_t seen = 0;
  for (const Step& step : made.recording.pushes.at(0).steps)
    for (const Observation& one : step.observations)
      if (const auto* cloud = std::get_if<PointCloud>(&one)) {
        ++seen;
        EXPECT_EQ(cloud->points_m.rows(), 2);
      }
  EXPECT_EQ(seen, made.recording.pushes.at(0).steps.size() - 1);
  EXPECT_THAT(made.notes, Contains(HasSubstr("/points: the cloud holds no point outside the robot at the step at")));
}

TEST(StreamViews, TheObjectAtRestIsSeenAtTheTimesThatAreGiven) {
  StreamPlan seen = stream_plan();
  seen.views_at_s = {0.5, 2};
  seen.views_where = "mapping.yaml:3: rest.views_at_s";
  const FromStreams made = recording_from(seen, lab());
  ASSERT_EQ(made.recording.rest.views.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    const DepthFrame& view = made.recording.rest.views[i];
    EXPECT_NEAR(view.time_s, seen.views_at_s[i], 1.0 / 60 + 1e-9);
    EXPECT_EQ(view.depth_m, picture(view.time_s));
    EXPECT_EQ(view.noise.sigma_m, 0.002);
  }
  EXPECT_EQ(images_of(made).size(), images_of(recording_from(stream_plan(), lab())).size()) << "no step lost its image";

  const auto refusal = [&](const SensorStreams& streams) -> std::string {
    try {
      recording_from(seen, streams);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  seen.views_at_s = {0.5, 200};
  EXPECT_THAT(refusal(lab()), AllOf(HasSubstr("rest.views_at_s"), HasSubstr("there is no view at 200.000 s"), HasSubstr("the nearest is")));
  seen.views_at_s = {0.5};
  SensorStreams blank = lab();
  blank.cameras[0].image = [](std::size_t) { return DepthImage(DepthImage::Zero(48, 64)); };
  EXPECT_THAT(refusal(blank), HasSubstr("shows nothing"));
  blank.cameras.clear();
  EXPECT_THAT(refusal(blank), HasSubstr("there are no depth images (topics.depth)"));
}

}  // namespace
}  // namespace palpate::acquisition::stream_views_test
