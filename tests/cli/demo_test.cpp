// label: oracle
// SPDX-License-Identifier: Apache-2.0
// `palpate demo`, the first thing that a newcomer runs: all of it is there, and the truth lies in the intervals.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "io/recording_folder.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/lab/pressed_block.hpp"
#include "palpate/report/words.hpp"

namespace palpate::io::demo_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

TEST(Demo, GoesTheWholeWayAndIsRight) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const test::TemporaryFolder folder("demo");
  const fs::path out = folder.path() / "out";
  const auto demo = [&] {
    const std::string command = std::string("'") + PALPATE_CLI + "' --json demo -o '" + out.string() + "' > '" +
                                (folder.path() / "json").string() + "' 2> '" + (folder.path() / "err").string() + "'";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };
  ASSERT_EQ(demo(), 0) << folder.get("err");
  EXPECT_TRUE(check_recording(read_recording(out / "recording")).empty());
  const auto read_json = [&](const std::string& file) { return nlohmann::json::parse(read_file(out / file)); };
  const nlohmann::json truth = read_json("truth.json"), result = read_json("result.json");
  EXPECT_EQ(nlohmann::json::parse(folder.get("json")).at("parameters"), result.at("parameters"));
  EXPECT_EQ(result.at("termination"), "converged");
  std::set<std::string> found;
  for (const auto& parameter : result.at("parameters")) {
    const std::string name = parameter.at("name");
    found.insert(name);
    const double true_value = truth.at(name == "young_modulus" ? "young_modulus_pa" : name);
    EXPECT_LE(parameter.at("lower_95").get<double>(), true_value) << name;
    EXPECT_GE(parameter.at("upper_95").get<double>(), true_value) << name;
  }
  EXPECT_EQ(found, (std::set<std::string>{"young_modulus", "poisson_ratio"}));
  EXPECT_THAT(folder.get("err"), HasSubstr("inside the 95 % interval"));
  EXPECT_THAT(folder.get("err"), Not(HasSubstr("OUTSIDE")));
  EXPECT_THAT(folder.get("err"), HasSubstr("taken as exact     "));
  // A push of its own, at another place than the two of the recording and with another force, by the lab's own solver.
  const nlohmann::json predicted = read_json("prediction/prediction.json");
  lab::PressedBlockOptions cube;
  cube.young_modulus_pa = truth.at("young_modulus_pa");
  cube.poisson_ratio = truth.at("poisson_ratio");
  cube.site_m = predicted.at("contact_m").at(0).get<double>() - cube.base_centre_m.x();
  const double force_n = predicted.at("force_n").at("value");
  for (const double seen_m : {-0.02, 0.03}) EXPECT_GT(std::abs(cube.site_m - seen_m), 0.02);
  for (const auto& push : truth.at("force_n"))
    for (const double seen_n : push) EXPECT_GT(std::abs(force_n - seen_n), 0.2);
  lab::PressedBlock pressed(cube);
  pressed.press(force_n);
  EXPECT_GE(pressed.travel_m(), predicted.at("travel_m").at("lower_95").get<double>());
  EXPECT_LE(pressed.travel_m(), predicted.at("travel_m").at("upper_95").get<double>());
  EXPECT_NEAR(predicted.at("travel_m").at("value").get<double>() / pressed.travel_m(), 1, 0.03);
  EXPECT_THAT(folder.get("err"), HasSubstr("$ palpate predict "));
  EXPECT_THAT(folder.get("err"), HasSubstr("true " + report::quantity(pressed.travel_m(), "m")));
  EXPECT_THAT(read_file(out / "report.html"), HasSubstr("</html>"));
  for (const char* figure : {"object", "force_travel", "posterior", "residuals", "per_push", "budget"})
    for (const char* kind : {".svg", ".png"})
      EXPECT_GT(fs::file_size(out / "figures" / (figure + std::string(kind))), 500u) << figure << kind;

  // A push that somebody adds is not the demonstration's to remove.
  std::ofstream(out / "recording/mine.txt") << "mine\n";
  EXPECT_EQ(demo(), 3);
  EXPECT_THAT(folder.get("err"), HasSubstr("choose another folder"));
  EXPECT_TRUE(fs::exists(out / "recording/mine.txt"));
  EXPECT_TRUE(fs::exists(out / "recording/recording.yaml"));
}

}  // namespace
}  // namespace palpate::io::demo_test
