// label: oracle
// SPDX-License-Identifier: Apache-2.0
// `palpate estimate --regions by-site` from a folder to result.json: a block of two halves on a table, pushed at one place of each.
// Truth and fit share their mesh: what meshes do to regions is tested where they are fitted.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "estimation/pushed_block.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/recording.hpp"
#include "said_by.hpp"
#include "temporary_folder.hpp"

namespace palpate::regions_test {
namespace {

constexpr double left_pa = 2e4, right_pa = 3.2e4;

class TwoHalves : public testing::Test {
 protected:
  void SetUp() override {
    if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
    Recording recording = estimation::pushed_block_recording();
    Support table;
    table.name = "table";
    table.kind = SupportKind::plane;
    table.select = NodeSelection::plane;
    table.tolerance_m = 1e-6;
    recording.supports = {table};
    recording.pushes.push_back(recording.pushes[0]);
    recording.pushes[0].name = "one";
    recording.pushes[1].name = "other";
    recording.pushes[0].site = "left";
    recording.pushes[1].site = "right";
    // Midway between the two places lies the border of the halves.
    for (Step& step : recording.pushes[0].steps) step.loads[0].contact_m.x() = 0.015;
    for (Push& push : recording.pushes)
      for (Step& step : push.steps) *step.loads[0].force_n *= 12;
    estimation::PushedBlock truth;
    truth.material = "linear";
    truth.young_pa = left_pa;
    truth.free_half = right_pa / left_pa;
    truth.points = 500;
    const estimation::Inputs clouds = estimation::clouds_of(truth, recording);
    std::size_t s = 0;
    for (Push& push : recording.pushes)
      for (Step& step : push.steps) {
        step.time_s = static_cast<double>(s);
        step.observations = {std::get<PointCloud>(clouds[s++][0])};
      }
    recording.rest.volume = estimation::kuhn_block(8, 6, 4, estimation::block_size_m);
    recording.model.material = "linear";
    recording.model.refine = "none";
    io::write_recording(recording, files / "block");
  }

  nlohmann::json estimated(const std::string& options) const {
    const std::string out = (files / "out").string();
    const std::string command = std::string(PALPATE_CLI) + " estimate '" + (files / "block").string() + "' -o '" + out + "' --quiet " +
                                options + " 2> /dev/null";
    const int status = std::system(command.c_str());
    EXPECT_EQ(WEXITSTATUS(status), 0);
    return nlohmann::json::parse(io::read_file(files / "out/result.json"));
  }
  const test::TemporaryFolder files{"two_halves"};
};

const nlohmann::json* young_of(const nlohmann::json& result, const std::string& region) {
  for (const auto& one : result["parameters"])
    if (one["name"] == "young_modulus" && one["region"] == region) return &one;
  return nullptr;
}

bool says(const nlohmann::json& result, const std::string& code) {
  for (const auto& verdict : result["verdicts"])
    if (verdict["code"] == code) return true;
  return false;
}

TEST_F(TwoHalves, EachSiteHasTheEOfItsHalf) {
  const nlohmann::json result = estimated("--regions by-site");
  for (const auto& [region, truth] : {std::pair{"left", left_pa}, {"right", right_pa}}) {
    const nlohmann::json* young = young_of(result, region);
    ASSERT_NE(young, nullptr) << region << result["parameters"].dump(1);
    EXPECT_LT((*young)["lower_95"].get<double>(), truth) << region;
    EXPECT_GT((*young)["upper_95"].get<double>(), truth) << region;
    EXPECT_LT((*young)["std"].get<double>(), 0.1 * truth) << region << ": an interval that says nothing";
    EXPECT_TRUE((*young)["determined"].get<bool>());
  }
  EXPECT_FALSE(says(result, "not_homogeneous"));
  EXPECT_FALSE(says(result, "model_does_not_fit"));
}

std::string outcome_of(const std::string& arguments, int& exit_code) {
  const test::Said said = test::said_by(std::string(PALPATE_CLI) + " " + arguments + " 2>&1");
  exit_code = said.exit_code;
  return said.text;
}

// The recording names no regions, and its mesh may be replaced: what was fitted is in the result.
TEST_F(TwoHalves, TheNextPushIsPlannedOnTheObjectThatWasFitted) {
  estimated("--regions by-site");
  Recording changed = io::read_recording_unchecked(files / "block");
  ASSERT_TRUE(changed.regions.empty());
  const auto planned = [&](const std::string& options) {
    const test::Said said = test::said_by(std::string(PALPATE_CLI) + " suggest '" + (files / "out").string() +
                                          "' --json --quiet --contacts 6 --tilts 1 " + options + " 2> /dev/null");
    EXPECT_EQ(said.exit_code, 0) << said.text;
    return nlohmann::json::parse(said.text, nullptr, false);
  };
  const nlohmann::json plan = planned("");
  ASSERT_TRUE(plan["touched"].get<bool>()) << plan.dump(1);
  EXPECT_EQ(plan["young_modulus_pa"].size(), 2u);
  ASSERT_FALSE(plan["pushes"].empty());
  for (const auto& push : plan["pushes"]) {
    EXPECT_TRUE(push["region"] == "left" || push["region"] == "right");
    EXPECT_EQ(push["view"], "cloud") << "of the recording";
  }
  changed.rest.volume = estimation::kuhn_block(4, 4, 2, estimation::block_size_m);
  io::write_recording(changed, files / "changed");
  EXPECT_EQ(planned("--recording '" + (files / "changed").string() + "'")["pushes"], plan["pushes"]);
}

double poisson_of(const nlohmann::json& result, const std::string& region) {
  for (const auto& one : result["parameters"])
    if (one["name"] == "poisson_ratio" && one["region"] == region) return one["value"];
  return std::nan("");
}

// Truth has one nu: two of them agree with it, and cost width.
TEST_F(TwoHalves, MayHavePoissonRatiosOfTheirOwn) {
  const nlohmann::json result = estimated("--regions by-site --poisson-by-region");
  ASSERT_EQ(result["parameters"].size(), 4u);
  for (const auto& one : result["parameters"]) {
    if (one["name"] != "poisson_ratio") continue;
    EXPECT_LT(one["lower_95"].get<double>(), 0.3) << one.dump();
    EXPECT_GT(one["upper_95"].get<double>(), 0.3) << one.dump();
  }
  EXPECT_NE(poisson_of(result, "left"), poisson_of(result, "right"));
  int code = 0;
  EXPECT_THAT(outcome_of("estimate '" + (files / "block").string() + "' -o '" + (files / "no").string() + "' --poisson-by-region", code),
              testing::HasSubstr("the object has one region"));
  EXPECT_EQ(code, 3);
  EXPECT_THAT(outcome_of("estimate '" + (files / "block").string() + "' -o '" + (files / "no").string() +
                             "' --regions by-site --poisson-by-region --poisson-ratio 0.3",
                         code),
              testing::HasSubstr("leave out the one or the other"));
  EXPECT_EQ(code, 3);
}

// What was learned of two halves is predicted and exported with both.
TEST_F(TwoHalves, ArePredictedAndExportedWithBoth) {
  for (const char* own : {"", " --poisson-by-region"}) {
    estimated(std::string("--regions by-site") + own);
    const std::string out = (files / "out").string();
    double travel_m[2] = {};
    int code = 0;
    for (const int half : {0, 1}) {
      const std::string text = outcome_of("predict '" + out + "' --radius 0.008 --force 1 --json --contact " + (half == 0 ? "0.015" : "0.045") + " 0.02 0.03", code);
      ASSERT_EQ(code, 0) << text;
      const nlohmann::json predicted = nlohmann::json::parse(text.substr(text.find('{')));
      travel_m[half] = predicted["travel_m"]["value"];
      EXPECT_GT(predicted["travel_m"]["std"].get<double>(), 0);
      EXPECT_EQ(predicted["regions"].size(), 2u);
    }
    EXPECT_NEAR(travel_m[0] / travel_m[1], right_pa / left_pa, 0.25);  // beside the other half it is a little stiffer
    const bool ccx = std::system("command -v ccx > /dev/null 2>&1") == 0;
    const std::string text = outcome_of("export '" + out + "' --to calculix -o '" + (files / "deck").string() + "'" + (ccx ? " --verify" : ""), code);
    EXPECT_EQ(code, 0) << text;
    if (ccx) {
      EXPECT_THAT(text, testing::HasSubstr("ccx moves every node as we do"));
    }
    EXPECT_THAT(outcome_of("export '" + out + "' --to drake --density 100 -o '" + (files / "drake").string() + "'", code),
                testing::HasSubstr("calculix, abaqus, febio, sofa take them"));
    EXPECT_EQ(code, 3);
    EXPECT_FALSE(std::filesystem::exists(files / "drake/object.sdf"));
  }
}

TEST_F(TwoHalves, AsOneTheyAreCalledNotHomogeneous) {
  const nlohmann::json result = estimated("--regions none");
  EXPECT_NE(young_of(result, ""), nullptr);
  EXPECT_TRUE(says(result, "not_homogeneous"));
}

}  // namespace
}  // namespace palpate::regions_test
