// label: unit
// SPDX-License-Identifier: Apache-2.0
// The transforms of both bags that `record` writes: a tree at every image, with the links where the joints put them.
#include <gtest/gtest.h>

#include <cstdlib>

#include "io/bag_tree.hpp"
#include "io/read_back.hpp"
#include "io/recording_folder.hpp"
#include "palpate/io/urdf.hpp"

namespace palpate::io::bag_frames_test {
namespace {

using namespace palpate::io::test;

void record(const TemporaryFolder& folder, const std::string& words) {
  const std::string base = folder.path().string();
  const std::string command = std::string("'") + PALPATE_CLI + "' --quiet record -o '" + base + "/folder' --bag '" + base + "/bag' --raw-bag '" +
                              base + "/raw' " + words + " 2> '" + base + "/err'";
  ASSERT_EQ(std::system(command.c_str()), 0) << folder.get("err");
}

RobotModel described(const MessageSource& bag, const std::filesystem::path& folder) {
  for (const Message& one : bag.messages)
    if (bag.topics[one.topic].name == "/robot_description") return parse_urdf(decode_string(one.data, ""), "", folder);
  ADD_FAILURE() << "no description";
  return {};
}

/// How well the pose of a carried camera is known changes from image to image, and a mapping states one for a topic: the bag of
/// steps has a topic an image then, which is said to be missing at all others.
Recording read_with_notes(const std::filesystem::path& folder) {
  BagMapping mapping = read_mapping(folder / "mapping.yaml");
  const SensorStreams streams = read_streams(read_bag(folder), mapping);
  return acquisition::recording_from(mapping.plan, streams).recording;
}

/// Image by image what the protocol itself recorded, to rounding; the raw bag's own times are matched by the pixels.
void expect_poses_of(const Recording& protocol, const Recording& found, bool same_steps) {
  std::vector<const Step*> steps;
  for (const Push& push : protocol.pushes)
    for (const Step& step : push.steps) steps.push_back(&step);
  std::size_t compared = 0;
  for (const Push& push : found.pushes)
    for (const Step& step : push.steps) {
      for (const Observation& one : step.observations) {
        const auto* image = std::get_if<DepthFrame>(&one);
        if (image == nullptr) continue;
        for (const Step* was : steps)
          for (const Observation& other : was->observations) {
            const auto* seen = std::get_if<DepthFrame>(&other);
            if (seen == nullptr || seen->depth_m != image->depth_m) continue;
            ++compared;
            EXPECT_LT((seen->T_base_camera.matrix() - image->T_base_camera.matrix()).norm(), 1e-12);
            if (!was->loads.empty() || same_steps) {
              ASSERT_TRUE(step.T_base_tip);
              EXPECT_LT((was->T_base_tip->matrix() - step.T_base_tip->matrix()).norm(), 1e-12);
            }
          }
      }
    }
  EXPECT_GE(compared, same_steps ? steps.size() : steps.size() / 2);
}

struct Case {
  const char* name;
  const char* words;
  bool carried = false;
  bool slips = false;  // the tip is not where the joints say
};
class BagFramesOfALab : public testing::TestWithParam<Case> {};

TEST_P(BagFramesOfALab, AreOneTreeAtEveryImage) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("bag_frames");
  record(folder, "--seed 5 --young-modulus 20000 --force-limit 3 --contact 0.6 0 0.15 " + std::string(GetParam().words));
  const Recording protocol = read_recording(folder.path() / "folder");
  for (const char* kind : {"bag", "raw"}) {
    SCOPED_TRACE(kind);
    const MessageSource bag = read_bag(folder.path() / kind);
    const BagTree tree = tree_of(bag);
    const RobotModel robot = described(bag, folder.path() / kind);
    expect_kinematics(tree, robot, GetParam().slips ? std::set<std::string>{"tip"} : std::set<std::string>{});
    expect_tip_and_camera(tree, "base", "tip");
    EXPECT_EQ(tree.parent.at("tip"), "stick");
    EXPECT_EQ(tree.parent.at("arm_base"), "base");
    EXPECT_EQ(tree.parent.at("camera"), GetParam().carried ? "hand_tilt" : "base");
    EXPECT_EQ(tree.fixed.contains("camera"), !GetParam().carried);
    const bool in_urdf = std::any_of(robot.links.begin(), robot.links.end(), [](const RobotLink& one) { return one.name == "camera"; });
    EXPECT_EQ(in_urdf, GetParam().carried);
    EXPECT_EQ(tree.frames.at("/wrench"), std::set<std::string>{"base"});
    EXPECT_EQ(tree.frames.at("/camera/depth/image"), std::set<std::string>{"camera"});
    const bool of_steps = kind == std::string("bag");
    const Recording back = GetParam().carried && of_steps ? read_with_notes(folder.path() / kind) : read_back(folder.path() / kind);
    expect_poses_of(protocol, back, of_steps);
  }
}

INSTANTIATE_TEST_SUITE_P(Robots, BagFramesOfALab,
                         testing::Values(Case{"standing", ""}, Case{"elsewhere", "--arm-at 0.1 0.05 20"},
                                         Case{"hand", "--camera hand --arm-at 0.1 0.05 20", true}, Case{"slips", "--slip-at 0.004", false, true}),
                         [](const auto& one) { return one.param.name; });

/// Nothing is known of a driver's links where its scene describes none.
TEST(BagFramesOfADriver, HangOnTheBase) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("bag_frames_driver");
  record(folder, "--driver '" PALPATE_SPRING_ROBOT "' --scene '" PALPATE_SOURCE_DIR "/examples/driver/scene' --force-limit 6 --contact 0.5 0 0.1");
  for (const char* kind : {"bag", "raw"}) {
    SCOPED_TRACE(kind);
    const BagTree tree = tree_of(read_bag(folder.path() / kind));
    EXPECT_EQ(tree.parent, (std::map<std::string, std::string>{{"tip", "base"}, {"camera", "base"}}));
    expect_tip_and_camera(tree, "base", "tip");
    expect_poses_of(read_recording(folder.path() / "folder"), read_back(folder.path() / kind), kind == std::string("bag"));
  }
}

/// Two runs alike say the same, byte by byte.
TEST(BagsOfALab, ComeOutAlikeAgain) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("bag_again");
  const auto files = [&] {
    record(folder, "--seed 5 --young-modulus 20000 --force-limit 2 --unloading-steps 0 --contact 0.6 0 0.15");
    std::map<std::string, std::string> bytes;
    for (const char* name : {"folder/recording.yaml", "bag/bag_0.mcap", "raw/raw_0.mcap", "raw/metadata.yaml", "raw/mapping.yaml"})
      bytes[name] = folder.get(name);
    for (const char* name : {"folder", "bag", "raw"}) std::filesystem::remove_all(folder.path() / name);
    return bytes;
  };
  const auto first = files(), again = files();
  for (const auto& [name, bytes] : first) EXPECT_TRUE(bytes == again.at(name)) << name;
}

/// Where nothing can be made of what is left of a bag, its end is the reason and not what seems to be missing.
TEST(BagsOfALab, ThatAreCutOffSaySoWithTheirMapping) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("bag_cut");
  record(folder, "--seed 5 --young-modulus 20000 --force-limit 2 --unloading-steps 0 --contact 0.6 0 0.15");
  const auto file = folder.path() / "bag" / "bag_0.mcap";
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  const std::string command = std::string("'") + PALPATE_CLI + "' info '" + (folder.path() / "bag").string() + "' 2> '" + folder.path().string() + "/err'";
  EXPECT_NE(std::system(command.c_str()), 0);
  EXPECT_NE(folder.get("err").find("the file is cut off at byte"), std::string::npos) << folder.get("err");
}

/// A calibration that was written the wrong way round puts the stick on the camera, which stands: then there is no contact.
TEST(BagsOfALab, InWhichAFixedFrameLeavesNoContactSayWhichOneItIs) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("bag_fixed");
  record(folder, "--seed 5 --young-modulus 20000 --force-limit 2 --unloading-steps 0 --contact 0.6 0 0.15");
  std::string mapping = folder.get("raw/mapping.yaml");
  const std::string tip = "tip: tip}";
  ASSERT_NE(mapping.find(tip), std::string::npos);
  mapping.replace(mapping.find(tip), tip.size(),
                  "tip: tip, fixed: [{parent: camera, child: stick, T_parent_child: {position_m: [0, 0, 0.1], quaternion_xyzw: [0, 0, 0, 1]}}]}");
  folder.put("raw/mapping.yaml", mapping);
  const std::string command = std::string("'") + PALPATE_CLI + "' info '" + (folder.path() / "raw").string() + "' 2> '" + folder.path().string() + "/err'";
  EXPECT_NE(std::system(command.c_str()), 0);
  for (const char* part : {"no contact was found", "Of the bag: the frame 'stick' stands on 'camera' as frames.fixed says"})
    EXPECT_NE(folder.get("err").find(part), std::string::npos) << folder.get("err");
}

}  // namespace
}  // namespace palpate::io::bag_frames_test
