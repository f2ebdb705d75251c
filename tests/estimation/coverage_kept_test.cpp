// label: unit
// SPDX-License-Identifier: Apache-2.0
// The outcomes of the coverage table that are kept in docs/coverage hold what is asked of them, and docs/uncertainty.md says of them
// what they say.
#include "estimation/coverage_outcomes.hpp"

namespace palpate::coverage::coverage_kept_test {
namespace {

namespace fs = std::filesystem;

using Both = std::array<Tally, 2>;  // of E, of nu

std::string contents(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

std::string text(const char* form, double a, double b) {
  char out[64];
  std::snprintf(out, sizeof out, form, a, b);
  return out;
}

/// | scene | row | n | 68, 95 % of E | of nu | bias of E, nu in standard deviations | of E, nu | rms of E, nu | over the bound |
std::string page_row(const std::string& scene, const std::string& row, const Both& both) {
  const Tally &e = both[0], &nu = both[1];
  const double n = e.count;
  const auto inside = [n](const Tally& one) { return text("%.0f, %.0f", 100 * one.in_68 / n, 100 * one.in_95 / n); };
  return "| " + scene + " | " + row + " | " + std::to_string(e.count) + " | " + inside(e) + " | " + inside(nu) + " | " +
         text("%+.2f, %+.2f", e.pulls / n, nu.pulls / n) + " | " + text("%+.1f %%, %+.3f", 100 * e.error / n, nu.error / n) + " | " +
         text("%.2f %%, %.3f", 100 * e.rms(), nu.rms()) + " | " + text("%.2f, %.2f", e.over_bound(), nu.over_bound()) + " |\n";
}

TEST(CoverageKept, ThePageSaysWhatTheKeptOutcomesSay) {
  const fs::path docs = fs::path(PALPATE_SOURCE_DIR) / "docs";
  Outcomes kept;
  for (const auto& entry : fs::directory_iterator(docs / "coverage"))
    if (entry.path().extension() == ".txt") kept.read(entry.path());
  if (kept.all().empty()) GTEST_SKIP() << "no outcomes are kept in docs/coverage yet";
  std::map<std::string, std::map<std::string, Both>> sums;  // a scene, a row
  for (const auto& [key, outcome] : kept.all()) {
    const auto& [scene, row, seed] = key;
    EXPECT_TRUE(seed == 1 || kept.find(scene, row, seed - 1)) << scene << " " << row << ": seed " << seed - 1 << " was left out";
    for (const std::string& of : {scene, std::string("together")}) {
      sums[of][row][0].add(outcome.young);
      sums[of][row][1].add(outcome.poisson);
    }
    if (outcome.by_calculix) {
      sums["by CalculiX"][row][0].add(outcome.young);
      sums["by CalculiX"][row][1].add(outcome.poisson);
    }
  }
  const std::string told = contents(docs / "uncertainty.md");
  for (const auto& [scene, of_rows] : sums) {
    for (const Row& row : rows()) {
      const auto found = of_rows.find(row.name);
      if (found == of_rows.end()) continue;
      const std::string line = page_row(scene, row.name, found->second);
      EXPECT_NE(told.find(line), std::string::npos) << "docs/uncertainty.md lacks this row:\n" << line;
      if (scene != "together") continue;
      const double rms_limit = row.depth_m > 0.03 ? 0.05 : 0;
      judge(row, "E", found->second[0], rms_limit);
      judge(row, "nu", found->second[1], rms_limit);
    }
  }
}

}  // namespace
}  // namespace palpate::coverage::coverage_kept_test
