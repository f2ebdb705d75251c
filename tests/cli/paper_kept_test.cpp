// label: unit
// SPDX-License-Identifier: Apache-2.0
// The seeds that are kept in docs/paper are whole, and docs/benchmarks.md says of them what they say.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "cli/paper_scores.hpp"
#include "cli/paper_seeds.hpp"
#include "temporary_folder.hpp"

namespace palpate::cli::paper_kept_test {
namespace {

namespace fs = std::filesystem;

const fs::path docs = fs::path(PALPATE_SOURCE_DIR) / "docs";

PaperRuns kept_in(const fs::path& folder) {
  const test::TemporaryFolder files("paper_kept");
  const SeedFolder joined(files / "joined");
  joined.take_from(folder);
  return joined.collect();
}

std::string contents(const fs::path& file) {
  std::stringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// | scene | seeds | rms of E, the paper's method / palpate | median | mean | inside, E / nu | simulated / most load cases |
std::string row(const SceneAnswers& scene, const std::string& what = "") {
  const SceneScores scores = scores_of(scene.trials);
  const Score &paper = scores.paper_compared, &palpate = scores.palpate;
  return fmt::format("| `{}`{} | {} | {:.1f} % / {:.1f} % | {:.1f} / {:.1f} % | {:+.1f} / {:+.1f} % | {} / {} of {} | {:.0f} / {} |", scene.scene->name,
                     what, scene.trials.size(), paper.rms_percent, scores.palpate_compared.rms_percent, paper.median_percent,
                     scores.palpate_compared.median_percent, paper.bias_percent, palpate.bias_percent,
                     palpate.inside_95, palpate.poisson_inside_95, palpate.asked, paper.solves, palpate.most_load_cases);
}

/// | scene | seeds | bias, rms of the predicted force, the paper's method | palpate | dent, the paper's method / palpate / nothing moves |
std::string prediction_row(const SceneAnswers& scene) {
  const SceneForesight all = foresight_of(scene.trials);
  const auto force = [](const Foresight& one) { return fmt::format("{:+.1f} %, {:.1f} %", one.force_bias_percent, one.force_rms_percent); };
  return fmt::format("| `{}` | {} | {} | {} | {:.2f} / {:.2f} / {:.2f} mm |", scene.scene->name, all.paper.seeds, force(all.paper),
                     force(all.palpate), 1000 * all.paper.dent_m, 1000 * all.palpate.dent_m, 1000 * all.still_m);
}

/// | model or fault | seeds | rms of E, the paper's method / palpate | mean | inside, E / nu | verdicts and in how many seeds |
std::string study_row(const StudyScore& row, std::size_t seeds) {
  std::string verdicts;
  for (const auto& [code, count] : row.verdicts) verdicts += fmt::format("{}`{}` {}", verdicts.empty() ? "" : ", ", code, count);
  if (row.palpate.asked == 0) return fmt::format("| {} | {} | {:.1f} % / - | {:+.1f} % / - | - | - |", row.what, seeds, row.paper.rms_percent, row.paper.bias_percent);
  return fmt::format("| {} | {} | {:.1f} % / {:.1f} % | {:+.1f} / {:+.1f} % | {} / {} of {} | {} |", row.what, seeds, row.paper.rms_percent,
                     row.palpate.rms_percent, row.paper.bias_percent, row.palpate.bias_percent, row.palpate.inside_95,
                     row.palpate.poisson_inside_95, row.palpate.asked, verdicts.empty() ? "none" : verdicts);
}

TEST(PaperKept, TheTableIsMadeOfTheSeedsThatAreKept) {
  const PaperRuns runs = kept_in(docs / "paper");
  ASSERT_FALSE(runs.scenes.empty());
  const std::string told = contents(docs / "benchmarks.md");
  for (const SceneAnswers& scene : runs.scenes) {
    EXPECT_NE(told.find(row(scene) + "\n"), std::string::npos) << "docs/benchmarks.md lacks this row:\n" << row(scene);
    if (std::isfinite(foresight_of(scene.trials).paper.dent_m)) {
      EXPECT_NE(told.find(prediction_row(scene) + "\n"), std::string::npos) << "docs/benchmarks.md lacks this row:\n" << prediction_row(scene);
    }
    for (std::size_t k = 0; k < scene.trials.size(); ++k) EXPECT_EQ(scene.trials[k].seed, k + 1) << scene.scene->name << ": a seed was left out";
  }
  for (std::size_t from = 0, to = 0; from < runs.studies.size(); from = to) {
    for (to = from; to < runs.studies.size() && runs.studies[to].study == runs.studies[from].study; ++to)
      EXPECT_EQ(runs.studies[to].seed, to - from + 1) << runs.studies[to].study->name << ": a seed was left out";
    for (const StudyScore& one : scores_of(std::span(runs.studies).subspan(from, to - from))) {
      const std::string wanted = study_row(one, to - from);
      EXPECT_NE(told.find(wanted + "\n"), std::string::npos) << "docs/benchmarks.md lacks this row:\n" << wanted;
    }
  }
  for (const Claim& claim : claims_of(runs.scenes)) {
    const std::string line = fmt::format("| {} | {} | {} |", claim.what, claim.holds ? "yes" : "no", claim.found);
    EXPECT_NE(told.find(line + "\n"), std::string::npos) << "docs/benchmarks.md lacks this row:\n" << line;
  }
}

TEST(PaperKept, SoIsTheRowOfAMeshInTheCowsPlace) {
  const PaperRuns runs = kept_in(docs / "paper" / "spot");
  ASSERT_EQ(runs.scenes.size(), 1u);
  EXPECT_EQ(runs.command(), "palpate paper -o OUT --seed 1 --seeds 100 --details-of 0 --scene cow --object spot_crane.obj --object-up y --object-size 0.28");
  const SceneAnswers& scene = runs.scenes[0];
  const std::string wanted = row(scene, ", Spot in its place");
  EXPECT_NE(contents(docs / "benchmarks.md").find(wanted + "\n"), std::string::npos) << "docs/benchmarks.md lacks this row:\n" << wanted;
  for (std::size_t k = 0; k < scene.trials.size(); ++k) EXPECT_EQ(scene.trials[k].seed, k + 1) << "a seed was left out";
}

// ---- One seed a scene in detail

std::string with_poisson(const std::string& text, const MethodAnswer& answer) {
  return std::isfinite(answer.poisson_ratio) ? fmt::format("{} (ν {:.2f})", text, answer.poisson_ratio) : text;
}

/// Over the truth; of an apparent modulus in kPa.
std::string of_paper(const MethodAnswer& answer, double truth_pa) {
  return std::isfinite(answer.young_modulus_pa) ? with_poisson(fmt::format("{:.2f}", answer.young_modulus_pa / truth_pa), answer) : "-";
}

std::string of_palpate(const MethodAnswer& answer, double truth_pa) {
  if (!std::isfinite(answer.young_modulus_pa)) return "-";
  return with_poisson(fmt::format("{:.2f} [{:.2f}, {:.2f}]", answer.young_modulus_pa / truth_pa, answer.lower_95_pa / truth_pa, answer.upper_95_pa / truth_pa),
                      answer);
}

std::string verdicts(const MethodAnswer& answer) {
  std::string out;
  for (const std::string& code : answer.verdicts)
    if (out.find("`" + code + "`") == std::string::npos) out += fmt::format("{}`{}`", out.empty() ? "" : ", ", code);
  return out.empty() ? "none" : out;
}

/// | scene | paper's method | on linear tetrahedra | palpate | verdicts |, a site a row; of a stuff that palpate knows the law of, that law's in a row of its own.
std::vector<std::string> rows_of(const SceneAnswers& scene) {
  const TrialAnswer& trial = scene.shown();
  const double unit_pa = scene.scene->apparent ? 1000 : trial.young_modulus_pa;
  std::vector<std::string> rows;
  const std::string name = fmt::format("`{}`{}", scene.scene->name, scene.scene->apparent ? ", apparent, kPa" : "");
  for (const SiteAnswer& site : trial.sites)
    rows.push_back(fmt::format("| {}, {} | {} | - | {} | {} |", name, site.site, of_paper(site.paper, site.young_modulus_pa),
                               of_palpate(site.palpate, site.young_modulus_pa), verdicts(trial.palpate)));
  if (!trial.sites.empty()) return rows;
  rows.push_back(fmt::format("| {} | {} | {} | {} | {} |", name, of_paper(trial.paper, unit_pa), of_paper(trial.paper_coarse, unit_pa),
                             of_palpate(trial.palpate, unit_pa), verdicts(trial.palpate)));
  if (!trial.other_law.empty())
    rows.push_back(fmt::format("| {}, {} law | - | - | {} | {} |", name, trial.other_law, of_palpate(trial.other, unit_pa), verdicts(trial.other)));
  return rows;
}

TEST(PaperKept, SoAreTheTablesOfSeedsInDetail) {
  const PaperRuns runs = kept_in(docs / "paper" / "details");
  EXPECT_EQ(runs.scenes.size(), lab::paper_scenes().size());
  EXPECT_EQ(runs.studies.size(), studies().size());
  const std::string told = contents(docs / "benchmarks.md");
  const auto expect_told = [&](const std::string& row) {
    EXPECT_NE(told.find(row + "\n"), std::string::npos) << "docs/benchmarks.md lacks this row:\n" << row;
  };
  for (const SceneAnswers& scene : runs.scenes) {
    for (const std::string& row : rows_of(scene)) expect_told(row);
    const TrialAnswer& trial = scene.shown();
    EXPECT_FALSE(trial.pictures.empty() && trial.views.empty()) << scene.scene->name << ": what was seen and what is simulated";
    EXPECT_FALSE(trial.samples.empty()) << scene.scene->name << ": samples alone";
    EXPECT_FALSE(trial.unused.empty()) << scene.scene->name << ": a push that was not used; " << trial.unused_stop;
    EXPECT_TRUE(!trial.sites.empty() || trial.surface.error_m2.size() > 0) << scene.scene->name << ": the paper's error function";
  }
  for (const StudyAnswer& study : runs.studies) {
    EXPECT_EQ(study.failed, "");
    for (const StudyRow& row : study.rows)
      expect_told(fmt::format("| {} | {} | {} | {} |", row.what, of_paper(row.paper, row.young_modulus_pa), of_palpate(row.palpate, row.young_modulus_pa),
                              row.palpate.failed.empty() ? verdicts(row.palpate) : "no answer: " + row.palpate.failed));
  }
}

}  // namespace
}  // namespace palpate::cli::paper_kept_test
