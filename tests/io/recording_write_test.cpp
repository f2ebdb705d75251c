// label: unit
// SPDX-License-Identifier: Apache-2.0
// Recordings that a program put together and a fit takes: what is written of them can be read, and says the same; what no file can
// say is refused before hours of pushing end in a folder that nobody can read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>

#include "io/made_up_recording.hpp"
#include "io/recording_folder.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/recording_values.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::io::recording_write_test {
namespace {

using namespace palpate::io::test;
using testing::HasSubstr;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

class WrittenRecording : public testing::Test {
 protected:
  WrittenRecording() : folder("written"), recording(made_up()) {}

  Recording read_back() {
    EXPECT_TRUE(wrong_values(recording).empty()) << wrong_values(recording)[0].where;
    write_recording(recording, folder.path() / "copy");
    return read_recording_unchecked(folder.path() / "copy");
  }

  std::string refusal() {
    try {
      write_recording(recording, folder.path() / "copy");
    } catch (const Error& error) {
      EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << "nothing is left";
      return error.where() + ": " + error.message();
    }
    return "was written";
  }

  std::vector<Step>& steps() { return recording.pushes[0].steps; }

  TemporaryFolder folder;
  Recording recording;
};

TEST_F(WrittenRecording, IsRight) { EXPECT_EQ(read_back().pushes.size(), recording.pushes.size()); }

TEST_F(WrittenRecording, TimesThatDoNotGoOnAreRefused) {
  for (Step& step : steps()) step.time_s = 0;  // a program that says none
  EXPECT_THAT(refusal(), HasSubstr("pushes[0].steps[1].time_s: is that of the step before, 0 s; give each step of a push its own"));
  for (std::size_t s = 0; s < steps().size(); ++s) steps()[s].time_s = -double(s);
  EXPECT_THAT(refusal(), HasSubstr("pushes[0].steps[1].time_s: goes back, from that of the step before; order the steps by time"));
  for (std::size_t s = 0; s < steps().size(); ++s) steps()[s].time_s = 1.7e18 + double(s);
  EXPECT_THAT(refusal(), HasSubstr("pushes[0].steps[0].time_s: is 1.7e+18 s, which cannot be; is it in milliseconds or nanoseconds?"));
  for (std::size_t s = 0; s < steps().size(); ++s) steps()[s].time_s = double(s);
  EXPECT_EQ(read_back().pushes[1].steps[0].time_s, 0) << "another push may begin at 0 again";
}

Markers two_markers() {
  Markers markers;
  markers.sigma_m = 2e-4;
  markers.rest_std_m = 1e-3;
  markers.rest_m.resize(2, 3);
  markers.rest_m << 0, 0, 0.1, 0.1, 0, 0.1;
  markers.observed_m = markers.rest_m;
  return markers;
}

TEST_F(WrittenRecording, MarkersWithoutNamesGetSome) {
  Markers second = two_markers();
  second.observed_m.row(0).setConstant(nan);
  second.observed_m(1, 2) = 0.099;
  steps()[1].observations = {two_markers()};
  steps()[2].observations = {second};
  const Recording back = read_back();
  for (const std::size_t s : {1u, 2u}) {
    const auto& was = std::get<Markers>(steps()[s].observations.at(0));
    const auto& is = std::get<Markers>(back.pushes[0].steps[s].observations.at(0));
    EXPECT_EQ(is.names, (std::vector<std::string>{"marker_1", "marker_2"}));
    EXPECT_EQ(is.rest_m, was.rest_m);
    EXPECT_EQ(is.rest_std_m, was.rest_std_m);
    EXPECT_EQ(is.observed_m.row(1), was.observed_m.row(1));
    EXPECT_EQ(is.observed_m.row(0).allFinite(), s == 1);
  }
}

TEST_F(WrittenRecording, MarkersThatAreAllHiddenAreNoObservation) {
  Markers hidden = two_markers();
  hidden.names = {"a", "b"};
  hidden.observed_m.setConstant(nan);
  const Observation cloud = steps()[0].observations[1];
  steps()[0].observations = {hidden};
  steps()[1].observations = {hidden, cloud};
  const Recording back = read_back();
  EXPECT_TRUE(back.pushes[0].steps[0].observations.empty());
  ASSERT_EQ(back.pushes[0].steps[1].observations.size(), 1u);
  EXPECT_EQ(std::get<PointCloud>(back.pushes[0].steps[1].observations[0]).points_m, std::get<PointCloud>(cloud).points_m);
}

TEST_F(WrittenRecording, ACloudsCameraIsWhoseItWas) {
  std::get<PointCloud>(steps()[0].observations[1]).camera = "left eye: 2";
  const Recording back = read_back();
  EXPECT_EQ(std::get<PointCloud>(back.pushes[0].steps[0].observations[1]).camera, "left eye: 2");
  EXPECT_GT(std::get<PointCloud>(back.pushes[0].steps[0].observations[1]).points_m.rows(), 0);
}

TEST_F(WrittenRecording, DirectionsAreOfUnitLength) {
  for (std::size_t s = 1; s < steps().size(); ++s) steps()[s].loads[0].direction = Vec3(0, 0, -2);
  Wrench cell;
  cell.force_sigma_n = 0.1;
  cell.along = Vec3(0, 0, -1.005);  // few digits
  cell.force_n = Vec3(0, 0, -3);
  steps()[1].observations = {cell};
  const Recording back = read_back();
  EXPECT_EQ(back.pushes[0].steps[1].loads.at(0).direction, Vec3(0, 0, -1));
  const auto& read = std::get<Wrench>(back.pushes[0].steps[1].observations.at(0));
  EXPECT_EQ(read.along, Vec3(0, 0, -1));
  EXPECT_NEAR((read.force_n - cell.force_n).norm(), 0, 1e-15);
  // What is of unit length keeps its digits.
  const Vec3 slanted = Vec3(0.3, -0.1, -1).normalized();
  EXPECT_EQ(unit_direction(slanted), slanted);
}

/// Only a disc's pressure is read.
TEST_F(WrittenRecording, ASphereSaysNothingOfPressure) {
  recording.tools[0].pressure = Pressure::punch;
  Tool ball = recording.tools[0];
  ball.name = "ball";
  ball.shape = ToolShape::sphere;
  recording.tools.push_back(ball);
  EXPECT_THAT(wrong_values(recording).at(0).where, HasSubstr("tools[1].pressure")) << "and is told so";
  write_recording(recording, folder.path() / "copy");
  const Recording back = read_recording_unchecked(folder.path() / "copy");
  EXPECT_EQ(back.tools.at(0).pressure, Pressure::punch);
  EXPECT_EQ(back.tools.at(1).pressure, Pressure::uniform);
}

TEST_F(WrittenRecording, ANoiseThatIsNotGivenIsRefused) {
  for (Observation& one : steps()[1].observations)
    if (auto* frame = std::get_if<DepthFrame>(&one)) frame->noise = {};
  EXPECT_TRUE(wrong_values(recording).empty());
  EXPECT_THAT(refusal(), HasSubstr("depth/push001_step0002_2: noise.sigma_m: is not given; state the standard deviation of the depth in metres"));
  recording = made_up();
  DepthFrame view = std::get<DepthFrame>(steps()[0].observations[0]);
  view.noise = {};
  recording.rest.volume.reset();
  recording.rest.views = {view};
  EXPECT_THAT(refusal(), HasSubstr("views/view_000: noise.sigma_m: is not given"));
}

TEST_F(WrittenRecording, OneRegionIsTheWholeObject) {
  recording.regions.resize(1);
  recording.regions[0].name = "all of it";
  EXPECT_TRUE(read_back().regions.empty());
}

TEST_F(WrittenRecording, PushesWithoutNamesGetSome) {
  recording.pushes[0].name = recording.pushes[1].name = "";
  const Recording back = read_back();
  EXPECT_EQ(back.pushes[0].name, "push 1");
  EXPECT_EQ(back.pushes[1].name, "push 2");
}

/// A program need not say by what the nodes of a clamp are chosen; no file can leave it out.
TEST_F(WrittenRecording, AClampIsWrittenWithWhatChoosesItsNodes) {
  recording.supports[0].kind = SupportKind::clamp;
  Support boxed = recording.supports[0];
  boxed.name = "boxed";
  boxed.box_max_m = Vec3(0.1, 0.1, 0.01);
  recording.supports.push_back(boxed);
  const Recording back = read_back();
  EXPECT_EQ(back.supports.at(0).select, NodeSelection::plane);
  EXPECT_EQ(back.supports.at(1).select, NodeSelection::box);
  EXPECT_EQ(back.supports[1].box_max_m, boxed.box_max_m);
}

}  // namespace
}  // namespace palpate::io::recording_write_test
