// label: unit
// SPDX-License-Identifier: Apache-2.0
// `palpate record --driver` and `palpate explore --driver`: a robot out of a shared library that was built from the C header
// alone, on a spring whose stiffness is known and on a half space whose E and nu are; and what is said of libraries that are none.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "io/recording_folder.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::io::driver_test {
namespace {

using namespace palpate::io::test;
using testing::AnyOf;
using testing::HasSubstr;

const std::string scene = PALPATE_SOURCE_DIR "/examples/driver/scene";

class Driver : public testing::Test {
 protected:
  void SetUp() override {
    if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  }
  int palpate(const std::string& arguments) {
    const std::string command = std::string("'") + PALPATE_CLI + "' " + arguments + " > '" + path("out") + "' 2> '" + path("err") + "'";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string path(const std::string& name) const { return (folder.path() / name).string(); }
  std::string record(const std::string& library, const std::string& more = "") const {
    return "--json record --driver '" + library + "' --scene '" + scene + "' -o '" + path("recording") + "' " + more;
  }
  const TemporaryFolder folder{"driver"};
  const std::string spring = PALPATE_SPRING_ROBOT;
  const std::string one_push = "--contact 0.5 0 0.1 --force-limit 8";
};

TEST_F(Driver, RecordsASpringWhoseStiffnessComesOut) {
  ASSERT_EQ(palpate(record(spring, one_push + " --contact 0.52 0.01 0.1 --driver-settings 640")), 0) << folder.get("err");
  const Recording made = read_recording(folder.path() / "recording");
  EXPECT_TRUE(check_recording(made).empty());
  ASSERT_EQ(made.pushes.size(), 2u);
  for (const Push& push : made.pushes) {
    ASSERT_EQ(push.steps.size(), 8u);  // rest, 2, 4, 6, 8 N, two on the way back, rest
    for (const Step& step : push.steps) {
      if (step.loads.empty()) continue;
      EXPECT_EQ(step.loads[0].direction, Vec3(0, 0, -1)) << "across the plate, where nothing is said";
      const auto* frame = std::get_if<DepthFrame>(&step.observations.back());
      ASSERT_NE(frame, nullptr);
      // The plate's middle as the camera saw it, and the force that the spring then has.
      const double seen_m = 0.6 - double(frame->depth_m.block(50, 70, 20, 20).mean());
      EXPECT_NEAR(-step.loads[0].force_n->z(), 640 * (0.1 - seen_m), 0.1);
    }
  }
  EXPECT_EQ(palpate("--json check '" + path("recording") + "' --stiffness 640"), 0) << folder.get("err");
  EXPECT_EQ(palpate("--json check '" + path("recording") + "' --stiffness 800"), 1) << "a fifth stiffer is noticed";
}

TEST_F(Driver, FolderAndBagGiveTheSameAnswer) {
  ASSERT_EQ(palpate(record(spring, one_push + " --bag '" + path("bag") + "'")), 0) << folder.get("err");
  const auto errors_of = [&](const std::string& name) {
    EXPECT_EQ(palpate("--json check '" + path(name) + "' --stiffness 800"), 0) << folder.get("err");
    return nlohmann::json::parse(folder.get("out")).at("errors");
  };
  const nlohmann::json from_folder = errors_of("recording"), from_bag = errors_of("bag");
  ASSERT_EQ(from_folder.size(), from_bag.size());
  ASSERT_GT(from_folder.size(), 3u);
  for (std::size_t i = 0; i < from_folder.size(); ++i) {
    EXPECT_EQ(from_folder[i].at("name"), from_bag[i].at("name"));
    const double std = from_folder[i].at("std");
    // What is not determined wanders within its prior on rounding.
    EXPECT_NEAR(from_folder[i].at("value").get<double>(), from_bag[i].at("value").get<double>(), 1e-6 * std);
    EXPECT_NEAR(from_bag[i].at("std").get<double>() / std, 1, 1e-6);
  }
}

TEST_F(Driver, GoesOnWhereARecordingWasCutOff) {
  ASSERT_EQ(palpate(record(spring, one_push)), 0) << folder.get("err");
  Recording made = read_recording(folder.path() / "recording");
  const std::size_t whole = made.pushes[0].steps.size();
  made.pushes[0].steps.resize(3);
  std::filesystem::remove_all(folder.path() / "recording");
  write_recording(made, folder.path() / "recording");
  EXPECT_EQ(palpate(record(spring, one_push)), 3) << "is there already";
  ASSERT_EQ(palpate(record(spring, one_push + " --resume")), 0) << folder.get("err");
  EXPECT_EQ(read_recording_unchecked(folder.path() / "recording").pushes[0].steps.size(), whole);
}

// The library answers by the closed form of a half space; the block that stands for it in the scene is twenty pads wide, the mesh
// of linear elements is not refined: the modulus that a contact shows, E / (1 - nu^2), comes out all the same.
TEST_F(Driver, ExploresAHalfSpaceWhoseModulusComesOut) {
  const int code = palpate("--json --seed 1 explore --driver '" + spring + "' --driver-settings 'soft 20000 0.3' --scene '" +
                           PALPATE_SOURCE_DIR "/examples/driver/soft_scene' -o '" + path("explored") +
                           "' --pushes 1 --contacts 6 --tilts 0 --levels 2 --refine none --poisson-ratio-within 0.3 " +
                           "--young-modulus-within 0.3");
  const nlohmann::json answer = nlohmann::json::parse(folder.get("out"), nullptr, false);
  ASSERT_TRUE(answer.is_object()) << folder.get("err");
  ASSERT_EQ(answer.at("pushes").size(), 1u);
  EXPECT_EQ(answer.at("fruitless"), 0);
  // The coarse mesh blurs the edge of the pad: its radius may come to be in doubt, and then the goal is not reached.
  const std::string narrow = "both intervals are as narrow as was asked for", doubted = narrow + ", but not to be believed: tool_radius_doubtful";
  EXPECT_THAT(answer.at("message").get<std::string>(), AnyOf(narrow, doubted));
  const bool in_doubt = answer.at("message") == doubted;
  EXPECT_EQ(answer.at("reached").get<bool>(), !in_doubt) << folder.get("err");
  EXPECT_EQ(code, in_doubt ? 1 : 0) << folder.get("err");
  EXPECT_THAT(folder.get("err"), HasSubstr(" after 1 push. Next: "));
  const auto& push = answer.at("pushes")[0];
  for (int axis = 0; axis < 2; ++axis)
    EXPECT_NEAR(push.at("contact_m")[std::size_t(axis)].get<double>(), axis == 0 ? 0.5 : 0.0, 0.04) << "where the gantry reaches";
  EXPECT_NEAR(push.at("contact_m")[2].get<double>(), 0.2, 1e-9);
  EXPECT_EQ(push.at("direction")[2], -1.0);
  double young_pa = 0, poisson = 0;
  for (const auto& parameter : answer.at("result").at("parameters")) {
    if (parameter.at("name") == "young_modulus") young_pa = parameter.at("value");
    if (parameter.at("name") == "poisson_ratio") poisson = parameter.at("value");
  }
  EXPECT_NEAR(young_pa / (1 - poisson * poisson) / (20000 / (1 - 0.3 * 0.3)), 1, 0.1) << young_pa << " " << poisson;
  EXPECT_NEAR(poisson, 0.3, 0.15);
  const Recording made = read_recording(folder.path() / "explored/recording");
  EXPECT_TRUE(check_recording(made).empty());
  ASSERT_EQ(made.pushes.size(), 1u);
  EXPECT_EQ(made.pushes[0].steps.size(), answer.at("result").at("steps").size());
  for (const char* file : {"result.json", "report.html", "exploration.json", "model/object.vtu"})
    EXPECT_TRUE(std::filesystem::exists(folder.path() / "explored" / file)) << file;
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "explored/truth.json")) << "nobody knows it";
}

TEST_F(Driver, ItsOwnLimitEndsThePushAndIsNamed) {
  ASSERT_EQ(palpate(record(spring, "--contact 0.5 0 0.1 --force-limit 45 --force-step 10 --driver-settings 2000")), 0) << folder.get("err");
  const nlohmann::json push = nlohmann::json::parse(folder.get("out")).at("pushes").at(0);
  EXPECT_EQ(push.at("stop"), "force limit of the robot");
  EXPECT_EQ(push.at("message"), "the force reached the robot's own limit of 40 N; 45 N were asked for");
  EXPECT_NEAR(push.at("highest_force_n"), 40, 1.2);
}

// Its camera goes around the block, and the shape comes from there: nothing of the scene's own is in the recording.
TEST_F(Driver, LooksAroundAndTheShapeComesFromWhatItSees) {
  const std::string block = "--driver-settings 'soft 20000 0.3' --scene '" PALPATE_SOURCE_DIR "/examples/driver/soft_scene' ";
  const std::string words = "--json record --driver '" + spring + "' " + block + "-o '" + path("recording") +
                            "' --contact 0.5 0 0.2 --force-limit 1.5 --force-step 0.5 --views 6";
  ASSERT_EQ(palpate(words), 0) << folder.get("err");
  const Recording made = read_recording(folder.path() / "recording");
  EXPECT_TRUE(check_recording(made).empty());
  ASSERT_EQ(made.rest.views.size(), 6u);
  EXPECT_FALSE(made.rest.surface);
  for (const DepthFrame& view : made.rest.views) {  // where the camera says that it stands, it sees the block's middle
    const Vec3 middle = view.T_base_camera.inverse() * Vec3(0.5, 0, 0.1);
    EXPECT_NEAR(middle.x(), 0, 1e-9);
    EXPECT_NEAR(middle.y(), 0, 1e-9);
    EXPECT_NEAR(middle.z(), 0.8, 1e-9);
  }
  EXPECT_EQ(palpate(words + " --resume"), 0) << "nothing is missing, and nobody looks again: " << folder.get("err");
  ASSERT_EQ(palpate("--json model '" + path("recording") + "' -o '" + path("model") + "'"), 0) << folder.get("err");
  const nlohmann::json model = nlohmann::json::parse(folder.get("out"));
  EXPECT_NEAR(model.at("volume_m3").get<double>() / 0.008, 1, 0.03) << folder.get("out");
}

TEST_F(Driver, OneOfTheFirstVersionIsStillUsed) {
  ASSERT_EQ(palpate(record(PALPATE_FIRST_ROBOT, one_push)), 0) << folder.get("err");
  EXPECT_EQ(read_recording(folder.path() / "recording").pushes.at(0).steps.size(), 8u);
}

TEST_F(Driver, WhatIsWrongIsSaidWithACure) {
  constexpr int usage = 2;
  const auto refused = [&](const std::string& arguments, const std::string& words, int code = 3) {
    EXPECT_EQ(palpate(arguments), code) << arguments;
    EXPECT_THAT(folder.get("err"), HasSubstr(words)) << arguments;
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "recording")) << arguments;
  };
  std::ofstream(path("text.so")) << "no library\n";
  refused(record(path("absent.so"), one_push), "there is no such file");
  refused(record(path("text.so"), one_push), "cannot be loaded");
  refused(record(PALPATE_NO_ROBOT, one_push), "has no entry `palpate_make_robot`");
  refused(record(spring, one_push + " --driver-settings soft"), "`soft` is no stiffness");
  refused(record(spring), "say where to push", usage);
  refused(record(spring, one_push + " --tool hammer"), "is no tool of the scene; its first is stick");
  refused(record(spring, one_push + " --direction 0 0 0"), "must not be zero", usage);
  refused(record(PALPATE_FIRST_ROBOT, one_push + " --views 3"), "--views: the driver does not carry its camera around", usage);
  refused("record --driver '" + spring + "' " + one_push + " -o '" + path("recording") + "'", "--scene FOLDER", usage);
  const std::string explore = "explore --driver '" + spring + "' -o '" + path("recording") + "' --scene '" + scene + "' ";
  refused(explore + "--compare", "a driver's world has one only", usage);
  refused(explore + "--seeds 3", "say --compare, too", usage);
  refused(explore + "--driver-settings 'soft 20000'", "Young's modulus (Pa) and Poisson ratio");
}

}  // namespace
}  // namespace palpate::io::driver_test
