// label: unit
// SPDX-License-Identifier: Apache-2.0
// The seeds that are kept in docs/paper are whole, and docs/benchmarks.md says of them what they say.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "cli/paper_scores.hpp"
#include "cli/paper_seeds.hpp"
#include "temporary_folder.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

std::string contents(const fs::path& file) {
  std::stringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// | scene | seeds | rms of E, the paper's method / palpate | mean | inside, E / nu | simulated / most load cases |
std::string row(const SceneAnswers& scene) {
  const SceneScores scores = scores_of(scene.trials);
  const Score &paper = scores.paper_compared, &palpate = scores.palpate;
  return fmt::format("| `{}` | {} | {:.1f} % / {:.1f} % | {:+.1f} / {:+.1f} % | {} / {} of {} | {:.0f} / {} |", scene.scene->name,
                     scene.trials.size(), paper.rms_percent, scores.palpate_compared.rms_percent, paper.bias_percent, palpate.bias_percent,
                     palpate.inside_95, palpate.poisson_inside_95, palpate.asked, paper.solves, palpate.most_load_cases);
}

TEST(PaperKept, TheTableIsMadeOfTheSeedsThatAreKept) {
  const test::TemporaryFolder files("paper_kept");
  const fs::path docs = fs::path(PALPATE_SOURCE_DIR) / "docs";
  const SeedFolder joined(files / "joined");
  joined.take_from(docs / "paper");
  const PaperRuns runs = joined.collect();
  ASSERT_FALSE(runs.scenes.empty());
  const std::string told = contents(docs / "benchmarks.md");
  for (const SceneAnswers& scene : runs.scenes) {
    EXPECT_NE(told.find(row(scene) + "\n"), std::string::npos) << "docs/benchmarks.md lacks this row:\n" << row(scene);
    for (std::size_t k = 0; k < scene.trials.size(); ++k) EXPECT_EQ(scene.trials[k].seed, k + 1) << scene.scene->name << ": a seed was left out";
  }
  for (const Claim& claim : claims_of(runs.scenes)) {
    const std::string line = fmt::format("| {} | {} | {} |", claim.what, claim.holds ? "yes" : "no", claim.found);
    EXPECT_NE(told.find(line + "\n"), std::string::npos) << "docs/benchmarks.md lacks this row:\n" << line;
  }
}

}  // namespace
}  // namespace palpate::cli
