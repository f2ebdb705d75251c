// label: oracle
// SPDX-License-Identifier: Apache-2.0
// `palpate paper`: both methods on one seed of a scene whose truth is known, the page and what it claims of the baseline.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "temporary_folder.hpp"

namespace paper_test {
namespace {

namespace fs = std::filesystem;

int palpate(const std::string& arguments) {
  const int status = std::system((std::string(PALPATE_CLI) + " " + arguments).c_str());
  return WEXITSTATUS(status);
}

TEST(Paper, BothMethodsAnswerAndAGridJudgesTheBaseline) {
  const palpate::test::TemporaryFolder files("paper");
  const fs::path out = files / "out";
  ASSERT_EQ(palpate("--quiet --threads 2 paper --quick --scene cube -o " + out.string()), 0);
  nlohmann::json told;
  std::ifstream(out / "paper.json") >> told;
  const auto& trial = told.at("scenes").at(0).at("trials").at(0);
  const double truth = trial.at("true_young_modulus_pa");
  EXPECT_GT(trial.at("paper").at("young_modulus_pa").get<double>(), 0.2 * truth);
  EXPECT_LT(trial.at("paper").at("young_modulus_pa").get<double>(), 5 * truth);
  EXPECT_GT(trial.at("palpate").at("young_modulus_pa").get<double>(), 0.5 * truth);
  EXPECT_LT(trial.at("palpate").at("young_modulus_pa").get<double>(), 2 * truth);
  const auto& grid = trial.at("grid_search");
  EXPECT_GT(grid.at("smallest_m2").get<double>(), 0);
  EXPECT_LT(grid.at("at_found_m2").get<double>(), 1.001 * grid.at("smallest_m2").get<double>()) << "its own minimum";
  EXPECT_EQ(trial.at("samples").size(), trial.at("readings").size()) << "every one of them";
  // At a place that no method saw: the force within a fifth, the surface nearer than if nothing had moved.
  ASSERT_GE(trial.at("unused_place").size(), 3u);
  const auto& unused = trial.at("unused_place").back();
  EXPECT_NEAR(unused.at("force_palpate_n").get<double>() / unused.at("force_n").get<double>(), 1, 0.2);
  EXPECT_LT(unused.at("surface_rms_m").at("palpate").get<double>(), unused.at("surface_rms_m").at("still").get<double>());
  const auto& dent = unused.at("dent_rms_m");  // some millimetres deep, and half of it foretold at least
  EXPECT_LT(dent.at("still").get<double>(), 0.01);
  EXPECT_LT(dent.at("palpate").get<double>(), 0.5 * dent.at("still").get<double>());
  const auto& registrations = trial.at("registrations");
  ASSERT_EQ(registrations.size(), 4u);
  EXPECT_LT(registrations.at(3).at("rms_m").get<double>(), registrations.at(0).at("rms_m").get<double>()) << "at the truth, at 3 E";
  std::stringstream page;
  page << std::ifstream(out / "paper.html").rdbuf();
  EXPECT_NE(page.str().find("<svg"), std::string::npos);
  EXPECT_NE(page.str().find("What it should show"), std::string::npos);
  std::size_t views = 0;
  for (std::size_t at = page.str().find("data:image/png"); at != std::string::npos; at = page.str().find("data:image/png", at + 1)) ++views;
  EXPECT_EQ(views, 5u) << "model, image, what is left of it, simulated, difference";
  EXPECT_EQ(page.str().find("http"), page.str().find("http://www.w3.org/2000/svg"));  // nothing is fetched

  // The seed is there now: again, and joined alone, it is the same page in no time.
  const auto contents = [](const fs::path& file) {
    std::stringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  };
  ASSERT_EQ(palpate("--quiet --threads 2 paper --quick --scene cube -o " + out.string()), 0);
  EXPECT_EQ(contents(out / "paper.html"), page.str());
  ASSERT_EQ(palpate("--quiet paper --from " + out.string() + " -o " + (files / "joined").string()), 0);
  EXPECT_EQ(contents(files / "joined" / "paper.html"), page.str());
  EXPECT_EQ(palpate("--quiet paper --seeds 1 --scene cube -o " + out.string() + " 2>" + (files / "refused").string()), 3);
  EXPECT_NE(contents(files / "refused").find("cube_0001.json: was made with other options"), std::string::npos);
}

TEST(Paper, UnknownSceneIsNamedWithTheOnesThereAre) {
  const palpate::test::TemporaryFolder files("paper_unknown");
  const fs::path said = files / "said";
  EXPECT_EQ(palpate("--quiet paper --quick --scene penguin -o /nonexistent/out 2>" + said.string()), 3);
  std::stringstream words;
  words << std::ifstream(said).rdbuf();
  for (const char* name : {"penguin", "cow", "between", "partial"}) EXPECT_NE(words.str().find(name), std::string::npos) << words.str();
}

TEST(Paper, AnOpenMeshInTheCowsPlaceIsRefusedBeforeAnythingIsRun) {
  const palpate::test::TemporaryFolder files("paper_open");
  const fs::path mesh = files / "open.obj", said = files / "said";
  std::ofstream(mesh) << "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n";
  EXPECT_EQ(palpate("paper --quick --object " + mesh.string() + " -o " + (files / "out").string() + " 2>" + said.string()), 3);
  std::stringstream words;
  words << std::ifstream(said).rdbuf();
  EXPECT_NE(words.str().find("open.obj"), std::string::npos) << words.str();
  EXPECT_NE(words.str().find("must be closed"), std::string::npos) << words.str();
  EXPECT_FALSE(fs::exists(files / "out"));
}

}  // namespace
}  // namespace paper_test
