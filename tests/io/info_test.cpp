// label: unit
// SPDX-License-Identifier: Apache-2.0
// `palpate info` as a program sees it.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "geometry/shapes.hpp"
#include "io/made_up_recording.hpp"
#include "io/recording_folder.hpp"
#include "palpate/io/bag_write.hpp"
#include "palpate/io/recording.hpp"
#include "sensing/still_life.hpp"

namespace palpate::io::info_test {
namespace {

using namespace palpate::io::test;

struct Outcome {
  int code = -1;
  std::string out, err;
};

Outcome info_of(const TemporaryFolder& folder) {
  const std::string quote = "'";
  const std::string base = folder.path().string();
  const std::string command =
      quote + PALPATE_CLI + "' info --json '" + base + "' > '" + base + "/out' 2> '" + base + "/err'";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, folder.get("out"), folder.get("err")};
}

class Info : public testing::Test {
 protected:
  void SetUp() override {
    if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
    put_cube_recording(folder);
  }
  TemporaryFolder folder{"info"};
};

TEST_F(Info, SaysWhatIsInARecording) {
  const Outcome outcome = info_of(folder);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const nlohmann::json all = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(all["object"]["tetrahedra"], 5);
  EXPECT_NEAR(all["object"]["volume_m3"].get<double>(), 1e-3, 1e-12);
  EXPECT_EQ(all["pushes"][0]["observations"]["cloud"], 2);
  EXPECT_EQ(all["pushes"][0]["points"], 50);
  EXPECT_TRUE(all["problems"].empty());
  EXPECT_NE(outcome.err.find("5 tetrahedra (tet4), 8 nodes, 100 x 100 x 100 mm"), std::string::npos) << outcome.err;
}

TEST_F(Info, ListsAllThatIsWrongAndExitsWithThree) {
  folder.put("clouds/b.xyz", cloud_text(1000));
  folder.put("frames.csv", replaced(folder.get("frames.csv"), "0.5,0,-2", "0,0,0"));
  const Outcome outcome = info_of(folder);
  EXPECT_EQ(outcome.code, 3);
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["problems"].size(), 2u) << outcome.out;
}

TEST_F(Info, AMaterialThatThereIsNotIsNamed) {
  folder.put("recording.yaml", replaced(index_text, "material: linear", "material: neo_hokean"));
  const Outcome outcome = info_of(folder);
  EXPECT_EQ(outcome.code, 3);
  const nlohmann::json problems = nlohmann::json::parse(outcome.out)["problems"];
  ASSERT_EQ(problems.size(), 1u) << outcome.out;
  EXPECT_EQ(problems[0]["where"], "model.material");
  EXPECT_NE(problems[0]["message"].get<std::string>().find("did you mean 'neo_hookean'?"), std::string::npos) << outcome.out;
}

TEST_F(Info, WhatCannotBeReadExitsWithThreeAndNamesFileLineAndField) {
  folder.put("recording.yaml", replaced(index_text, "element: tet4", "elemnt: tet4"));
  const Outcome outcome = info_of(folder);
  EXPECT_EQ(outcome.code, 3);
  const nlohmann::json all = nlohmann::json::parse(outcome.out);
  EXPECT_NE(all["error"]["where"].get<std::string>().find("recording.yaml:10: model.elemnt"), std::string::npos)
      << outcome.out;
}

TEST(InfoOfABag, ListsItsTopics) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("bag");
  const std::string command = "'" + std::string(PALPATE_CLI) + "' info --json '" + PALPATE_SOURCE_DIR +
                              "/tests/io/files/peer_lz4.mcap' > '" + folder.path().string() + "/out' 2> '" +
                              folder.path().string() + "/err'";
  ASSERT_EQ(std::system(command.c_str()), 0) << folder.get("err");
  const nlohmann::json all = nlohmann::json::parse(folder.get("out"));
  EXPECT_EQ(all["topics"][0]["topic"], "/wrench");
  EXPECT_EQ(all["topics"][0]["messages"], 12);
  EXPECT_EQ(all["topics"][0]["understood"], true);
}

/// What is said of a bag; arguments behind it.
Outcome told_of(const TemporaryFolder& folder, const std::string& verb, const std::string& name) {
  const std::string base = folder.path().string();
  const int status = std::system(("'" + std::string(PALPATE_CLI) + "' " + verb + " --json '" + base + "/" + name + "' > '" +
                                  base + "/out' 2> '" + base + "/err'")
                                     .c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, folder.get("out"), folder.get("err")};
}

TEST(InfoOfABag, WhatHoldsNoMessageIsRefusedByName) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("no_bag");
  folder.put("magic.bag", "#ROSBAG V2.0\n");
  folder.put("garbage.bag", "#ROSBAG V2.0\n" + std::string(300, '\x07'));
  folder.put("text.bag", "not a bag at all");
  folder.put("magic.mcap", std::string("\x89MCAP0\r\n") + std::string("\x01\x08\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0", 17));
  folder.put("picture.mcap", std::string("\x89PNG\r\n\x1a\n") + std::string(100, ' '));
  for (const std::string name : {"magic.bag", "garbage.bag", "text.bag", "magic.mcap", "picture.mcap"}) {
    for (const std::string& verb : {std::string("info"), "estimate -o '" + folder.path().string() + "/result'"}) {
      const Outcome outcome = told_of(folder, verb, name);
      EXPECT_EQ(outcome.code, 3) << verb << " " << name;
      EXPECT_NE(outcome.err.find(name), std::string::npos) << outcome.err;
      EXPECT_EQ(outcome.err.find("FILL_IN"), std::string::npos) << name;
      if (name != "picture.mcap" && name != "text.bag") continue;
      EXPECT_NE(outcome.err.find("does not start as a bag does"), std::string::npos) << verb << outcome.err;
    }
  }
}

TEST(InfoOfABag, SaysWhatTheMappingLeavesAloneAndWhatItsClocksAre) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("left_out");
  Recording recording = made_up();
  for (Push& push : recording.pushes)
    for (Step& step : push.steps)
      for (Observation& one : step.observations)
        if (auto* cloud = std::get_if<PointCloud>(&one)) cloud->points_m.setConstant(0.0625);
  write_bag(recording, folder.path() / "bag");
  const std::string text = folder.get("bag/mapping.yaml");
  Outcome outcome = told_of(folder, "info", "bag");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(nlohmann::json::parse(outcome.out)["bag"]["left_out"].empty()) << outcome.out;
  EXPECT_NE(outcome.err.find("nothing is wrong with it"), std::string::npos);

  std::string blind = text;
  blind.erase(blind.find("  depth:\n"), blind.find("  clouds:\n") - blind.find("  depth:\n"));
  folder.put("bag/mapping.yaml", blind);
  outcome = told_of(folder, "info", "bag");
  const nlohmann::json left_out = nlohmann::json::parse(outcome.out)["bag"]["left_out"];
  ASSERT_EQ(left_out.size(), 3u) << outcome.out;
  EXPECT_EQ(left_out[1]["topic"], "/camera/depth/image");
  EXPECT_EQ(left_out[1]["key"], "topics.depth");
  EXPECT_NE(outcome.err.find("left out   /camera/depth/image (depth images)"), std::string::npos) << outcome.err;
  EXPECT_EQ(outcome.err.find("nothing is wrong with it"), std::string::npos) << outcome.err;

  folder.put("bag/mapping.yaml", text + "clocks: {camera_offset_s: estimate}\n");
  const nlohmann::json clocks = nlohmann::json::parse(told_of(folder, "info", "bag").out)["clocks"];
  ASSERT_EQ(clocks.size(), 1u);
  EXPECT_EQ(clocks[0]["sensor"], "/camera/depth/image");
  EXPECT_EQ(clocks[0]["usable"], false);
  EXPECT_EQ(clocks[0]["taken_off_s"], 0.0);

  folder.put("bag/mapping.yaml", replaced(text, "model: \"constant\", sigma_m: 0.002", "model: realsense_d345"));
  outcome = told_of(folder, "info", "bag");
  EXPECT_EQ(outcome.code, 3);
  const nlohmann::json error = nlohmann::json::parse(outcome.out)["error"];
  EXPECT_NE(error["where"].get<std::string>().find("topics.depth[0].noise.model"), std::string::npos) << outcome.out;
  EXPECT_NE(error["where"].get<std::string>().find("mapping.yaml:"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("did you mean 'realsense_d435'?"), std::string::npos) << outcome.out;
}

/// The still life of a box on a table.
void put_still_life(const TemporaryFolder& folder, const sensing::StillLife& truth) {
  Recording recording = sensing::still_life(truth);
  recording.name = "still life";
  recording.rest.surface = shapes::box(Vec3(0.1, 0.1, 0.1), Vec3(0, 0, 0.6));
  Support table;
  table.name = "table";
  table.kind = SupportKind::plane;
  table.plane = {Vec3(0, 0, 0.6), Vec3::UnitZ()};
  table.tolerance_m = 0.001;
  recording.supports = {table};
  Tool stick;
  stick.name = "stick";
  stick.shape = ToolShape::disc;
  stick.radius_m = 0.01;
  recording.tools = {stick};
  for (Push& push : recording.pushes) {
    push.name = "push " + std::to_string(&push - recording.pushes.data());
    for (Step& step : push.steps)
      for (Load& load : step.loads) {
        load.tool = "stick";
        load.contact_m = Vec3(0.05, 0.05, 0.7);
      }
  }
  std::filesystem::remove_all(folder.path());
  write_recording(recording, folder.path());
}

TEST_F(Info, ComparesTheScatterOfUnloadedStepsWithWhatIsStated) {
  put_still_life(folder, {});
  Outcome outcome = info_of(folder);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const nlohmann::json right = nlohmann::json::parse(outcome.out)["static_scatter"];
  ASSERT_EQ(right.size(), 2u) << outcome.out;
  EXPECT_EQ(right[0]["repeats"], 8);
  EXPECT_NEAR(right[0]["measured"].get<double>(), 2e-3, 0.1 * 2e-3);
  EXPECT_NE(outcome.err.find("measured from 8 unloaded frames; stated 2"), std::string::npos) << outcome.err;
  EXPECT_EQ(outcome.err.find("intervals would be"), std::string::npos) << outcome.err;

  sensing::StillLife wrong;
  wrong.stated_depth_m = 1e-3;
  wrong.stated_force_n = 0.25;
  put_still_life(folder, wrong);
  outcome = info_of(folder);
  EXPECT_EQ(outcome.code, 0) << "a doubt is no error";
  EXPECT_NE(outcome.err.find("intervals would be too narrow"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("intervals would be too wide"), std::string::npos) << outcome.err;
  EXPECT_TRUE(nlohmann::json::parse(outcome.out)["static_scatter"][0]["doubtful"].get<bool>());
}

// What was forgotten counts as exact: whoever reads it here can still say it.
TEST_F(Info, SaysHowWellEverythingIsKnown) {
  put_still_life(folder, {});
  Outcome outcome = info_of(folder);
  const nlohmann::json all = nlohmann::json::parse(outcome.out);
  ASSERT_EQ(all["cameras"].size(), 1u) << outcome.out;
  EXPECT_EQ(all["cameras"][0]["noise_sigma_m"], 2e-3);
  EXPECT_EQ(all["stated"]["force_scale_std"], (nlohmann::json{0, 0}));
  EXPECT_NE(outcome.err.find("its scale exact"), std::string::npos) << outcome.err;
  folder.put("recording.yaml", replaced(folder.get("recording.yaml"), "force_scale_std: 0\n", "force_scale_std: 0.02\n") +
                                   "\nregions:\n  - {name: low, kind: box, min_m: [-1, -1, -1], max_m: [1, 1, 0.65]}\n  - {name: high, kind: rest}\n");
  outcome = info_of(folder);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("its scale 2 %"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("regions    low (box), high (rest)"), std::string::npos) << outcome.err;
}

TEST_F(Info, SaysWhereNothingMasksTheArm) {
  put_still_life(folder, {});
  EXPECT_NE(info_of(folder).err.find("nothing masks the arm in 2 images"), std::string::npos);
  const std::string text = folder.get("recording.yaml");
  std::string told = text;
  for (std::size_t at = 0; (at = told.find("kind: depth,", at)) != std::string::npos; at += 12) told.insert(at + 12, " robot_is_masked: true,");
  folder.put("recording.yaml", told);
  EXPECT_EQ(info_of(folder).err.find("nothing masks"), std::string::npos) << "no arm is in the picture";
  told = text;
  for (std::size_t at = 0; (at = told.find("loads:", at)) != std::string::npos;) {
    const std::size_t indent = at - told.rfind('\n', at) - 1;
    const std::string pose = "T_base_tip: [[1, 0, 0, 0.05], [0, 1, 0, 0.05], [0, 0, 1, 0.7], [0, 0, 0, 1]]\n" + std::string(indent, ' ');
    told.insert(at, pose);
    at += pose.size() + 6;
  }
  folder.put("recording.yaml", told);
  EXPECT_EQ(info_of(folder).err.find("nothing masks"), std::string::npos) << "the stick is masked by its radius";
  folder.put("arm.urdf",
             "<robot name='arm'><link name='arm'><visual><geometry><sphere radius='0.1'/></geometry></visual>"
             "<visual><geometry><mesh filename='package://arm/hand.dae'/></geometry></visual></link></robot>");
  folder.put("recording.yaml", told + "\nrobot: {urdf: arm.urdf}\n");
  const Outcome outcome = info_of(folder);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("2 images of the pressed object are of steps without joints_rad"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("only the stick is masked"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("hand.dae"), std::string::npos) << "a shape that cannot be read is said: " << outcome.err;
}

// A UR's controller tells poses in a base that is its description's turned by half a turn: the arm was masked on the wrong side.
TEST_F(Info, SaysWhereARobotStandsFarFromItsTip) {
  put_still_life(folder, {});
  std::string told = folder.get("recording.yaml");
  for (std::size_t at = 0; (at = told.find("loads:", at)) != std::string::npos;) {
    const std::string indent(at - told.rfind('\n', at) - 1, ' ');
    const std::string pose = "T_base_tip: [[1, 0, 0, 0.05], [0, 1, 0, 0.05], [0, 0, 1, 0.7], [0, 0, 0, 1]]\n" + indent + "joints_rad: [0]\n" + indent;
    told.insert(at, pose);
    at += pose.size() + 6;
  }
  folder.put("recording.yaml", told + "\nrobot: {urdf: arm.urdf, joints: [lift]}\n");
  for (const char* height : {"0.3", "-0.3"}) {
    folder.put("arm.urdf", std::string("<robot name='arm'><link name='foot'/><link name='hand'><visual><geometry><sphere radius='0.01'/></geometry></visual></link>"
                                       "<joint name='lift' type='prismatic'><parent link='foot'/><child link='hand'/><axis xyz='0 0 1'/>"
                                       "<limit lower='-1' upper='1' effort='1' velocity='1'/><origin xyz='0 0 ") +
                               height + "'/></joint></robot>");
    const Outcome outcome = info_of(folder);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(outcome.err.find("no link comes nearer to the tip (T_base_tip) than 0.70 m") != std::string::npos, height[0] == '-') << outcome.err;
  }
}

// A bag of ours has images with masks, and clouds: the mapping to start from names them all.
TEST(InfoOfABag, SuggestsMaskAndClouds) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("bag_suggested");
  write_bag(made_up(), folder.path() / "bag");
  std::filesystem::remove(folder.path() / "bag/mapping.yaml");
  const std::string command = "'" + std::string(PALPATE_CLI) + "' info --json '" + (folder.path() / "bag").string() + "' > '" +
                              folder.path().string() + "/out' 2> '" + folder.path().string() + "/err'";
  ASSERT_EQ(std::system(command.c_str()), 0) << folder.get("err");
  const std::string mapping = nlohmann::json::parse(folder.get("out")).at("mapping");
  EXPECT_NE(mapping.find("image: /camera/depth/image, info: /camera/depth/camera_info, mask: /camera/mask,"), std::string::npos) << mapping;
  EXPECT_NE(mapping.find("  # clouds:\n  #   - {topic: /points,"), std::string::npos) << mapping;
}

}  // namespace
}  // namespace palpate::io::info_test
