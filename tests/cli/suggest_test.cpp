// label: unit
// SPDX-License-Identifier: Apache-2.0
// `palpate suggest` before the first touch, on an object that nobody has pushed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "geometry/shapes.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/lab/arm.hpp"
#include "palpate/suggest.hpp"
#include "temporary_folder.hpp"

namespace suggest_test {
namespace {

namespace fs = std::filesystem;
using namespace palpate;

/// A box of 100 x 80 x 90 mm on a table, seen from one side; nothing was pushed yet.
Recording box_on_table() {
  Recording recording;
  recording.name = "box";
  recording.rest.surface = shapes::box(Vec3(0.1, 0.08, 0.09), Vec3(0.5, 0, 0));
  Support table;
  table.kind = SupportKind::plane;
  table.name = "table";
  table.plane = {Vec3::Zero(), Vec3::UnitZ()};
  table.tolerance_m = 0.002;
  recording.supports = {table};
  recording.environment.planes = {table.plane};
  recording.force_scale_std = 0.01;
  Tool stick;
  stick.name = "stick";
  stick.shape = ToolShape::disc;
  stick.radius_m = 0.015;
  recording.tools = {stick};
  return recording;
}

struct Answer {
  int exit_code = -1;
  nlohmann::json json;
};

Answer suggest(const std::string& folder, const std::string& options) {
  const test::TemporaryFolder files("suggest_answer");
  const fs::path out = files / "answer.json";
  const std::string command = std::string(PALPATE_CLI) + " suggest " + folder + " --json --quiet --contacts 6 --tilts 1 " +
                              options + " > " + out.string() + " 2> /dev/null";
  Answer answer;
  answer.exit_code = WEXITSTATUS(std::system(command.c_str()));
  std::ifstream file(out);
  answer.json = nlohmann::json::parse(file, nullptr, false);
  return answer;
}

class Suggest : public testing::Test {
 protected:
  void SetUp() override { io::write_recording(box_on_table(), folder_); }
  const test::TemporaryFolder files_{"suggest"};
  const std::string folder_ = (files_ / "box").string();
};

// An unloaded step says little of the sensors, and the encoder may have been read in another step than the first one under load.
TEST(SuggestSensors, ErrorsAreThoseOfStepsThatHaveThem) {
  Recording recording = box_on_table();
  Tool base = recording.tools[0];
  base.name = "base";
  recording.tools.push_back(base);
  Load nothing;
  nothing.tool = "stick";
  nothing.contact_m = Vec3(0.55, 0, 0.09);
  nothing.direction = -Vec3::UnitZ();
  nothing.force_n = Vec3::Zero();
  Load beside = nothing, pressing = nothing;
  beside.tool = "base";
  pressing.force_n = Vec3(0, 0, -2);
  pressing.force_std_n = 0.04;
  pressing.force_relative_std = 0.01;
  pressing.contact_std_m = 0.002;
  ToolTravel travel;
  travel.tool = "stick";
  travel.sigma_m = 7e-5;
  Push push;
  push.name = "down";
  push.force_tare_std_n = 0.02;
  push.travel_offset_std_m = 3e-4;
  push.steps.resize(3);
  push.steps[0].loads = {nothing};
  push.steps[1].loads = {beside, pressing};
  push.steps[2].loads = {beside, pressing};
  push.steps[2].observations = {travel};
  recording.pushes = {push};
  SuggestOptions options;
  options.tool = "stick";
  options.candidates.contacts = 2;
  options.candidates.tilts = 1;
  const estimation::SensorPlan sensors = prepare_pushes(recording, options).sensors;
  EXPECT_EQ(sensors.force_std_n, 0.04);
  EXPECT_EQ(sensors.force_relative_std, 0.01);
  EXPECT_EQ(sensors.contact_std_m, 0.002);
  EXPECT_EQ(sensors.force_tare_std_n, 0.02);
  EXPECT_EQ(sensors.travel_offset_std_m, 3e-4);
  ASSERT_TRUE(sensors.travel_sigma_m);
  EXPECT_EQ(*sensors.travel_sigma_m, 7e-5);

  // A last push that nobody read a travel of says nothing against the encoder.
  recording.pushes.push_back(push);
  recording.pushes[1].name = "again";
  recording.pushes[1].travel_offset_std_m = 0;
  recording.pushes[1].steps[2].observations.clear();
  const estimation::SensorPlan of_both = prepare_pushes(recording, options).sensors;
  ASSERT_TRUE(of_both.travel_sigma_m);
  EXPECT_EQ(*of_both.travel_sigma_m, 7e-5);
  EXPECT_EQ(of_both.travel_offset_std_m, 3e-4) << "of the push that it was read in";
}

TEST(SuggestSensors, PlacesOfACameraThatThereIsNotAreSaidToBeLeftAside) {
  Recording recording = box_on_table();
  PointCloud cloud;
  cloud.points_m = recording.rest.surface->vertices_m;
  cloud.sigma_m = VectorX::Constant(1, 1e-3);
  recording.pushes.resize(1);
  recording.pushes[0].steps.resize(1);
  recording.pushes[0].steps[0].observations = {cloud};
  SuggestOptions options;
  options.candidates.contacts = 2;
  options.candidates.tilts = 1;
  for (const int views : {0, 3}) {
    options.viewpoints = views;
    const auto warnings = prepare_pushes(recording, options).warnings;
    EXPECT_EQ(std::count_if(warnings.begin(), warnings.end(), [](const std::string& one) { return one.find("views are left aside") != std::string::npos; }),
              views > 0 ? 1 : 0);
  }
}

TEST_F(Suggest, OfAnObjectInRegionsEveryPushSaysWhichOfThemItPresses) {
  Recording halves = box_on_table();
  Region left, right;
  left.name = "left";
  left.select = RegionSelection::box;
  left.box_min_m = Vec3(0, -1, -1);
  left.box_max_m = Vec3(0.55, 1, 1);
  right.name = "right";
  halves.regions = {left, right};
  const std::string folder = (files_ / "halves").string();
  io::write_recording(halves, folder);
  const Answer answer = suggest(folder, "--young-modulus-within 0.1 --poisson-ratio-within 0.05");
  ASSERT_EQ(answer.exit_code, 0);
  EXPECT_EQ(answer.json["young_modulus_pa"].size(), 2u);
  std::set<std::string> pressed;
  for (const auto& push : answer.json["pushes"]) {
    pressed.insert(push["region"].get<std::string>());
    EXPECT_EQ(push["region"], push["contact_m"][0].get<double>() > 0.55 ? "right" : "left");
    EXPECT_EQ(push["expected"]["region_log_young_std"].size(), 2u);
  }
  EXPECT_EQ(pressed, (std::set<std::string>{"left", "right"}));
  ASSERT_TRUE(answer.json["target_reached"].get<bool>());
  const auto& after = answer.json["sequence"].back()["expected"];
  for (const auto& std : after["region_log_young_std"]) EXPECT_LE(std::sinh(1.96 * std.get<double>()), 0.1001) << "both E were asked for";
  EXPECT_LE(1.96 * after["poisson_std"].get<double>(), 0.05);
}

TEST_F(Suggest, OddNumbersOfTheSceneAreSaid) {
  Recording odd = box_on_table();
  odd.environment.gravity_m_s2 = Vec3(0, 0, -5);
  odd.density_kg_m3 = 100;
  const std::string folder = (files_ / "odd").string();
  io::write_recording(odd, folder);
  const Answer answer = suggest(folder, "--for poisson-ratio --force-limit 2.5");
  ASSERT_EQ(answer.exit_code, 0);
  ASSERT_TRUE(answer.json.is_object());
  EXPECT_THAT(answer.json["warnings"].dump(), testing::HasSubstr("on earth it is 9.81"));
}

TEST_F(Suggest, BeforeTheFirstTouchPushesAreSortedAndWithinTheLimits) {
  const Answer answer = suggest(folder_, "--for poisson-ratio --force-limit 2.5");
  ASSERT_EQ(answer.exit_code, 0);
  EXPECT_FALSE(answer.json["touched"].get<bool>());
  EXPECT_TRUE(answer.json["so_far"]["log_young_std"].is_null()) << "nothing is known of E";
  // A camera was made up, and so were the sensors' errors: both are said.
  EXPECT_EQ(answer.json["warnings"].size(), 2u);
  EXPECT_EQ(answer.json["views"].size(), 4u);
  ASSERT_GT(answer.json["pushes"].size(), 10u);
  double last = 0;
  for (const auto& push : answer.json["pushes"]) {
    EXPECT_LE(push["force_n"].get<double>(), 2.5 * (1 + 1e-12));
    EXPECT_GT(push["force_n"].get<double>(), 0.1);
    EXPECT_LT(push["direction"][2].get<double>(), 0.3) << "from above or from the side";
    EXPECT_GT(push["contact_m"][2].get<double>(), 0.0);
    const double std = push["expected"]["poisson_std"];
    EXPECT_GE(std, last);
    last = std;
  }
  EXPECT_LT(answer.json["pushes"][0]["expected"]["poisson_std"].get<double>(), 0.1);
  ASSERT_EQ(answer.json["sequence"].size(), 3u);
  EXPECT_LT(answer.json["sequence"][2]["expected"]["poisson_std"], answer.json["sequence"][0]["expected"]["poisson_std"]);
}

// Three digits of nu are printed: rows that differ beyond them are ranked by what nobody sees.
TEST_F(Suggest, RowsThatPromiseTheSameAreSaidToBeTies) {
  const fs::path text = files_ / "text";
  const std::string command = std::string(PALPATE_CLI) + " suggest " + folder_ + " --contacts 10 --tilts 1 --for poisson-ratio --show 40 > " +
                              text.string() + " 2>&1";
  ASSERT_EQ(WEXITSTATUS(std::system(command.c_str())), 0);
  std::ifstream file(text);
  std::vector<std::string> promised;  // "0.031", a row each
  std::string ties;
  for (std::string line; std::getline(file, line);) {
    std::smatch part;
    static const std::regex row(R"(^ +[0-9]+  [+-][0-9.]+ [+-][0-9.]+ [+-][0-9.]+ .* % +(?:[0-9.]+ %|-) +([0-9.]+)(?:   .*)?$)");
    if (std::regex_match(line, part, row)) promised.push_back(part[1]);
    if (line.find("promise the same within rounding") != std::string::npos) ties = line;
  }
  ASSERT_GT(promised.size(), 20u);
  std::string expected;
  for (std::size_t first = 0, after = 0; first < promised.size(); first = after) {
    for (after = first + 1; after < promised.size() && promised[after] == promised[first];) ++after;
    if (after > first + 1) expected += (expected.empty() ? "" : ", ") + std::to_string(first + 1) + " to " + std::to_string(after);
  }
  ASSERT_FALSE(expected.empty()) << "no ties here: this test says nothing";
  EXPECT_NE(ties.find("no " + expected + " promise"), std::string::npos) << ties << "\nexpected " << expected;
}

TEST_F(Suggest, SameSeedSameAnswerAndIntervalsHardlyDependOnTheGuess) {
  const Answer once = suggest(folder_, "--for young-modulus"), again = suggest(folder_, "--for young-modulus");
  ASSERT_EQ(once.exit_code, 0);
  EXPECT_EQ(once.json, again.json);
  // Twice as stiff, twice the force, the same deformation: only the force's own errors weigh less.
  const Answer stiffer = suggest(folder_, "--for young-modulus --young-modulus 40000");
  const auto &soft = once.json["pushes"][0], &stiff = stiffer.json["pushes"][0];
  EXPECT_NEAR(stiff["force_n"].get<double>() / soft["force_n"].get<double>(), 2, 1e-6);
  EXPECT_NEAR(stiff["travel_m"].get<double>(), soft["travel_m"].get<double>(), 1e-9);
  EXPECT_NEAR(std::log(stiff["expected"]["poisson_std"].get<double>() / soft["expected"]["poisson_std"].get<double>()), 0,
              0.1);
}

TEST_F(Suggest, SaysHowManyPushesTheIntervalsThatAreAskedForTake) {
  const Answer wide = suggest(folder_, "--young-modulus-within 0.2 --poisson-ratio-within 0.2");
  ASSERT_EQ(wide.exit_code, 0);
  EXPECT_EQ(wide.json["sequence"].size(), 1u);
  const Answer narrow = suggest(folder_, "--young-modulus-within 0.035 --poisson-ratio-within 0.01");
  ASSERT_EQ(narrow.exit_code, 0);
  EXPECT_TRUE(narrow.json["target_reached"].get<bool>());
  const auto& sequence = narrow.json["sequence"];
  ASSERT_GT(sequence.size(), 1u);
  const auto reached = [](const nlohmann::json& after) {
    return std::sinh(1.96 * after["log_young_std"].get<double>()) <= 0.035001 && 1.96 * after["poisson_std"].get<double>() <= 0.01;
  };
  EXPECT_TRUE(reached(sequence.back()["expected"]));
  EXPECT_FALSE(reached(sequence[sequence.size() - 2]["expected"]));
  // The force's scale is known to 1 %: no number of pushes comes below.
  const Answer never = suggest(folder_, "--young-modulus-within 0.015");
  EXPECT_EQ(never.exit_code, 0);
  EXPECT_FALSE(never.json["target_reached"].get<bool>());
  EXPECT_THAT(never.json["warnings"].back().get<std::string>(), testing::HasSubstr("30 pushes come to E within 2"));
}

TEST_F(Suggest, TheArmOfTheRecordingLimitsWhatIsCompared) {
  Recording recording = box_on_table();
  recording.robot = lab::arm();
  recording.rest.surface->vertices_m.col(0).array() += 0.25;  // its far side is out of reach
  const std::string near = (files_ / "near").string(), far = (files_ / "far").string();
  io::write_recording(recording, near);
  const Answer some = suggest(near, "--tip-link tip");
  ASSERT_EQ(some.exit_code, 0);
  EXPECT_GT(some.json["refused"].value("out of the robot's reach", 0), 10);
  EXPECT_GT(some.json["pushes"].size(), 0u);
  recording.rest.surface->vertices_m.col(0).array() += 1.25;
  io::write_recording(recording, far);
  const Answer none = suggest(far, "--tip-link tip");
  EXPECT_EQ(none.exit_code, 3);
  EXPECT_THAT(none.json["error"]["message"].get<std::string>(), testing::HasSubstr("out of the robot's reach"));
  // Nothing was pushed, so nobody knows where the tip is: said, and not looked at.
  const Answer unasked = suggest(far, "");
  ASSERT_EQ(unasked.exit_code, 0);
  EXPECT_THAT(unasked.json["warnings"].dump(), testing::HasSubstr("joint limits are not looked at"));
  EXPECT_EQ(suggest(near, "--tip-link nail").exit_code, 3);
  EXPECT_EQ(suggest(folder_, "--tip-link tip").exit_code, 3);
}

TEST_F(Suggest, APlaceThatNoToolReachesIsAnInputErrorThatSaysWhy) {
  EXPECT_EQ(suggest(folder_, "--contact 0.55 0.04 0.09").exit_code, 0);
  const Answer below = suggest(folder_, "--contact 0.55 0.04 0 --direction 0 0 1");
  EXPECT_EQ(below.exit_code, 3);
  EXPECT_THAT(below.json["error"]["message"].get<std::string>(), testing::HasSubstr("no push is possible"));
}

TEST_F(Suggest, WhatSupportsLetHappenBesideTheModelIsSaid) {
  Recording recording = box_on_table();
  recording.supports[0].kind = SupportKind::table;
  recording.supports[0].contact = ContactLaw::frictionless;
  const std::string folder = (files_ / "smooth").string();
  io::write_recording(recording, folder);
  const Answer answer = suggest(folder, "");
  ASSERT_EQ(answer.exit_code, 0);
  EXPECT_THAT(answer.json["warnings"].dump(), testing::HasSubstr("'table' (frictionless) is taken to hold the object down"));
  EXPECT_GT(answer.json["not_held"].get<int>(), 0) << "slanted pushes would slide it";
}

TEST(SuggestAfterAFit, AResultOfATouchThatSlippedIsNotBuiltOn) {
  Identification answer;
  answer.verdicts = {{"nu_not_determined", "The Poisson ratio is not determined."}};
  EXPECT_EQ(why_not_to_build_on(answer), "");
  answer.verdicts.push_back({"contact_slipped", "The tool seems to have slipped by 4 mm."});
  EXPECT_EQ(why_not_to_build_on(answer), "contact_slipped: The tool seems to have slipped by 4 mm.");
}

}  // namespace
}  // namespace suggest_test
