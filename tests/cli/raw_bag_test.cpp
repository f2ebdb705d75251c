// label: unit
// SPDX-License-Identifier: Apache-2.0
// What the lab's sensors said all the while, cut into steps again, against what the push protocol recorded itself.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "io/read_back.hpp"
#include "io/recording_folder.hpp"
#include "io/rosbag2_metadata.hpp"
#include "palpate/io/ros_messages.hpp"
#include "palpate/io/urdf.hpp"

namespace palpate::io::raw_bag_test {
namespace {

using namespace palpate::io::test;

void record(const TemporaryFolder& folder, const std::string& words) {
  const std::string base = folder.path().string();
  const std::string command = std::string("'") + PALPATE_CLI + "' --quiet record -o '" + base + "/folder' --raw-bag '" + base +
                              "/raw' " + words + " 2> '" + base + "/err'";
  ASSERT_EQ(std::system(command.c_str()), 0) << folder.get("err");
}

const DepthFrame* image_of(const Step& step) {
  for (const Observation& one : step.observations)
    if (const auto* frame = std::get_if<DepthFrame>(&one)) return frame;
  return nullptr;
}

class RawBag : public testing::TestWithParam<const char*> {};

TEST_P(RawBag, GivesTheStepsOfTheProtocol) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("raw_bag");
  record(folder, GetParam());
  const Recording protocol = read_recording(folder.path() / "folder");
  const MessageSource bag = read_bag(folder.path() / "raw");
  EXPECT_TRUE(bag.warnings.empty()) << bag.warnings.front();
  EXPECT_EQ(rosbag2_metadata(folder.path() / "raw").messages, bag.messages.size());
  const Recording found = read_back(folder.path() / "raw");
  EXPECT_TRUE(check_recording(found).empty());
  ASSERT_EQ(found.pushes.size(), protocol.pushes.size());
  // The protocol records steps that are hardly above the threshold of contact, 0.3 N; whether they are found is chance.
  const auto pressed = [](const Recording& recording) {
    std::vector<const Step*> out;
    for (const Push& push : recording.pushes)
      for (const Step& step : push.steps)
        if (!step.loads.empty() && step.loads[0].force_n->norm() > 0.4) out.push_back(&step);
    return out;
  };
  const std::vector<const Step*> expected = pressed(protocol), steps = pressed(found);
  ASSERT_GE(expected.size(), 3u);
  ASSERT_EQ(steps.size(), expected.size());
  const auto travel_of = [](const Step& step) {
    for (const Observation& one : step.observations)
      if (const auto* travel = std::get_if<ToolTravel>(&one)) return travel->travel_m;
    return std::nan("");
  };
  for (std::size_t i = 0; i < steps.size(); ++i) {
    // The sensor's noise is 0.05 N: means over 0.5 s of 50 Hz and tares over a second differ by a few hundredths.
    EXPECT_LT((*steps[i]->loads[0].force_n - *expected[i]->loads[0].force_n).norm(), 0.06) << i;
    // Both trace the contact back to zero force, each from another stretch of it; neither is nearer to the truth than it says.
    EXPECT_LT((steps[i]->loads[0].contact_m - expected[i]->loads[0].contact_m).norm(), found.pushes[0].travel_offset_std_m);
    EXPECT_NEAR(travel_of(*steps[i]), travel_of(*expected[i]), found.pushes[0].travel_offset_std_m);
    if (std::string(GetParam()).find("--object") == std::string::npos) {
      EXPECT_NEAR(steps[i]->loads[0].contact_m.z(), 0.15, 2 * found.pushes[0].travel_offset_std_m) << "the cube's top";
    }
    EXPECT_EQ(steps[i]->unloading, expected[i]->unloading);
    ASSERT_NE(image_of(*steps[i]), nullptr);
    EXPECT_EQ(image_of(*steps[i])->depth_m, image_of(*expected[i])->depth_m);
  }
  for (std::size_t p = 0; p < found.pushes.size(); ++p) {
    // The object at rest, before the push and after it.
    for (const Step* one : {&found.pushes[p].steps.front(), &found.pushes[p].steps.back()}) EXPECT_TRUE(one->loads.empty());
    const DepthFrame *before = image_of(found.pushes[p].steps.front()), *after = image_of(found.pushes[p].steps.back());
    ASSERT_NE(before, nullptr) << p;
    ASSERT_NE(after, nullptr) << p;
    EXPECT_EQ(before->depth_m, image_of(protocol.pushes[p].steps.front())->depth_m) << p;
    EXPECT_EQ(after->depth_m, image_of(protocol.pushes[p].steps.back())->depth_m) << p;
    EXPECT_GE(found.pushes[p].travel_offset_std_m, protocol.pushes[p].travel_offset_std_m) << p;
    EXPECT_LE(found.pushes[p].travel_offset_std_m, 0.0004) << "half an increment and what the arm is known to";
  }
}

/// What is built from views must not hold the shape that only the simulation knows.
TEST(RawBagOfViews, HoldsTheViewsAndNotTheTrueSurface) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("raw_bag_views");
  record(folder, "--seed 5 --young-modulus 20000 --force-limit 2 --unloading-steps 0 --views 2 --contact 0.6 0 0.15");
  EXPECT_EQ(folder.get("raw/mapping.yaml").find("surface_mesh"), std::string::npos);
  const Recording protocol = read_recording(folder.path() / "folder"), found = read_back(folder.path() / "raw");
  EXPECT_FALSE(found.rest.surface);
  ASSERT_EQ(found.rest.views.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) EXPECT_EQ(found.rest.views[k].depth_m, protocol.rest.views[k].depth_m);
}

/// Viewers find the robot's meshes by their whole path, and so does a reader to whom the folder was given.
TEST(RawBagOfAnArm, DescribesItWithMeshesThatAreFound) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("raw bag & arm");
  record(folder, "--seed 5 --young-modulus 20000 --force-limit 2 --unloading-steps 0 --contact 0.6 0 0.15");
  const MessageSource bag = read_bag(folder.path() / "raw");
  std::string urdf;
  for (const Message& one : bag.messages)
    if (bag.topics[one.topic].name == "/robot_description") urdf = decode_string(one.data, "", MessageEncoding::cdr);
  const std::string url = "<mesh filename=\"file://" + std::filesystem::absolute(folder.path()).parent_path().string() + "/";
  EXPECT_NE(urdf.find(url), std::string::npos) << urdf.substr(0, 600);
  EXPECT_NE(urdf.find("raw%20bag%20%26%20arm"), std::string::npos) << "a URL has no blanks";
  const RobotModel protocol = *read_recording(folder.path() / "folder").robot;
  std::filesystem::rename(folder.path() / "raw", folder.path() / "moved");
  std::vector<std::string> left_out;
  const RobotModel described = parse_urdf(urdf, "", folder.path() / "moved", &left_out);
  EXPECT_TRUE(left_out.empty()) << left_out.front();
  ASSERT_EQ(described.links.size(), protocol.links.size());
  for (std::size_t k = 0; k < protocol.links.size(); ++k) {
    ASSERT_EQ(described.links[k].visual.size(), protocol.links[k].visual.size());
    for (std::size_t s = 0; s < protocol.links[k].visual.size(); ++s)
      EXPECT_TRUE(described.links[k].visual[s].mesh.vertices_m.isApprox(protocol.links[k].visual[s].mesh.vertices_m, 1e-9));
  }
}

/// The ball is so soft under the pad that its force leaves the noise over half a second.
INSTANTIATE_TEST_SUITE_P(Objects, RawBag,
                         testing::Values("--seed 5 --young-modulus 20000 --force-limit 5", "--seed 3 --object ball --travel-limit 0.006"),
                         [](const auto& one) { return one.index == 0 ? "cube" : "ball"; });

}  // namespace
}  // namespace palpate::io::raw_bag_test
