// label: unit
// SPDX-License-Identifier: Apache-2.0
// `palpate info` as a program sees it.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "io/recording_folder.hpp"

namespace palpate::io {
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

}  // namespace
}  // namespace palpate::io
