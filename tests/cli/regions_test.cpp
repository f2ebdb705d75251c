// label: oracle
// SPDX-License-Identifier: Apache-2.0
// `palpate estimate --regions by-site` from a folder to result.json: a block of two halves on a table, pushed at one place of each.
// Truth and fit share their mesh: what meshes do to regions is tested where they are fitted.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "estimation/pushed_block.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/recording.hpp"
#include "temporary_folder.hpp"

namespace palpate {
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

TEST_F(TwoHalves, AsOneTheyAreCalledNotHomogeneous) {
  const nlohmann::json result = estimated("--regions none");
  EXPECT_NE(young_of(result, ""), nullptr);
  EXPECT_TRUE(says(result, "not_homogeneous"));
}

}  // namespace
}  // namespace palpate
