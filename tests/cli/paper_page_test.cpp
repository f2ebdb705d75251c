// label: unit
// SPDX-License-Identifier: Apache-2.0
// What the page of `palpate paper` says of answers that were made up: right, wrong, missing, and without a truth.
#include "cli/paper_page.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <utility>

#include "cli/paper_json.hpp"
#include "cli/paper_overview.hpp"
#include "cli/paper_tables.hpp"
#include "cli/paper_words.hpp"

namespace palpate::cli::paper_page_test {
namespace {

MethodAnswer answer(double young_pa, double lower_pa, double upper_pa, int solves) {
  MethodAnswer out = no_answer();
  out.young_modulus_pa = young_pa;
  out.poisson_ratio = 0.3;
  out.lower_95_pa = lower_pa;
  out.upper_95_pa = upper_pa;
  out.solves = out.load_cases = solves;
  out.converged = true;
  return out;
}

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TrialAnswer trial(double paper_pa, const MethodAnswer& palpate) {
  TrialAnswer out;
  out.seed = 1;
  out.young_modulus_pa = 10e3;
  out.poisson_ratio = 0.3;
  out.paper = out.paper_coarse = answer(paper_pa, nan, nan, 500);
  out.palpate = palpate;
  return out;
}

SceneAnswers scene(const char* name, std::vector<TrialAnswer> trials) { return {&lab::paper_scene(name), std::move(trials)}; }

TEST(PaperClaims, HoldWhereBothSidesSayWhatTheyShould) {
  const auto claims = claims_of({scene("cube", {trial(13e3, answer(10.4e3, 9.8e3, 11e3, 90))})});
  ASSERT_EQ(claims.size(), 4u);
  for (const Claim& claim : claims) EXPECT_TRUE(claim.holds) << claim.what;
}

TEST(PaperClaims, FailOneByOneAndNameTheScene) {
  const TrialAnswer good = trial(13e3, answer(10.4e3, 9.8e3, 11e3, 90));
  const auto failing = [&](const TrialAnswer& bad) {
    std::string failed;
    int at = 0;
    for (const Claim& claim : claims_of({scene("cow", {good}), scene("cube", {good}), scene("teddy", {bad})})) {
      if (!claim.holds) failed += std::to_string(at) + (claim.found.find("teddy") != std::string::npos ? "named " : " ");
      ++at;
    }
    return failed;
  };
  EXPECT_EQ(failing(good), "");
  EXPECT_EQ(failing(trial(10.1e3, answer(10.4e3, 9.8e3, 11e3, 90))), "0named ") << "worse than the paper's method";
  EXPECT_EQ(failing(trial(13e3, answer(10.4e3, 10.2e3, 11e3, 90))), "2 ") << "two of three intervals hold the truth";
  EXPECT_EQ(failing(trial(13e3, answer(10.4e3, 9.8e3, 11e3, 101))), "3named ") << "more than a fifth of the solves";
  // No answer is no good answer, and neither bias nor interval.
  TrialAnswer none = trial(13e3, no_answer());
  EXPECT_EQ(failing(none).substr(0, 7), "0named ");
  EXPECT_EQ(scores_of({none, good}).palpate.without, 1);
  EXPECT_NEAR(scores_of({none, good}).palpate.bias_percent, 100 * std::log(1.04), 1e-9);
}

// Two answers as made-up as they are: 13 and 7.7 kPa of 10 have errors of +-0.26 in the logarithm.
TEST(PaperScores, AreMeanSpreadAndRootMeanSquare) {
  const TrialAnswer high = trial(13e3, answer(10.4e3, 9.8e3, 11e3, 90)), low = trial(10e3 / 1.3, answer(10.4e3, nan, nan, 80));
  const SceneScores scores = scores_of({high, low});
  EXPECT_NEAR(scores.paper.bias_percent, 0, 1e-9);
  EXPECT_NEAR(scores.paper.rms_percent, 100 * std::log(1.3), 1e-9);
  EXPECT_NEAR(scores.paper.spread_percent, 100 * std::sqrt(2) * std::log(1.3), 1e-9);
  EXPECT_NEAR(scores.palpate.spread_percent, 0, 1e-5);
  EXPECT_EQ(scores.palpate.most_load_cases, 90);
  EXPECT_EQ(scores.paper.most_load_cases, 500);
  EXPECT_TRUE(std::isnan(scores_of({high}).paper.spread_percent)) << "one has no spread";
}

TEST(PaperClaims, SeedsWithoutAnAnswerOfThePapersMethodDecideNothing) {
  const TrialAnswer good = trial(13e3, answer(10.4e3, 9.8e3, 11e3, 90)), worse = trial(10.1e3, answer(10.4e3, 9.8e3, 11e3, 90));
  TrialAnswer unanswered = trial(nan, answer(10e3, 9.8e3, 11e3, 90));
  const auto only = claims_of({scene("cube", {unanswered})});
  EXPECT_FALSE(only.at(0).holds) << "nothing was compared";
  EXPECT_FALSE(only.at(1).holds);
  EXPECT_TRUE(only.at(2).holds) << "intervals can be judged";
  const auto beside = claims_of({scene("cube", {good}), scene("foam9cm", {unanswered, unanswered})});
  EXPECT_TRUE(beside.at(0).holds);
  EXPECT_NE(beside.at(0).found.find("2 of 2 in foam9cm"), std::string::npos) << beside.at(0).found;
  EXPECT_FALSE(claims_of({scene("cube", {worse, unanswered})}).at(0).holds) << "a win by default must not make up for a loss";
}

TEST(PaperForesight, IsOfTheHighestForceThatBothExpectSomethingOf) {
  TrialAnswer near = trial(13e3, answer(13e3, 12e3, 14e3, 90)), far = near, none = near;
  const auto step = [](double paper_n, double palpate_n) {
    UnusedStep out;
    out.force_n = 2;
    out.paper = {paper_n, 0, 0.004}, out.palpate = {palpate_n, 0, 0.002};
    out.dent_still_m = 0.01;
    return out;
  };
  near.unused = {step(9, 9), step(2.2, 2), step(nan, 2)};  // of the last one the paper's method expects nothing
  near.unused.back().paper.dent_m = nan;
  far.unused = {step(1.6, 2.1)};
  const SceneForesight all = foresight_of({near, far, none});
  EXPECT_EQ(all.paper.seeds, 2);
  EXPECT_NEAR(all.paper.force_bias_percent, -5, 1e-9);
  EXPECT_NEAR(all.paper.force_rms_percent, std::sqrt(250.0), 1e-9);
  EXPECT_NEAR(all.palpate.force_bias_percent, 2.5, 1e-9);
  EXPECT_NEAR(all.paper.dent_m, 0.004, 1e-12);
  EXPECT_NEAR(all.palpate.dent_m, 0.002, 1e-12);
  EXPECT_NEAR(all.still_m, 0.01, 1e-12);
  EXPECT_EQ(foresight_table(scene("cube", {near})), "") << "one seed is in the table above";
  EXPECT_NE(foresight_table(scene("cube", {near, far})).find("<td>-5.0 %</td><td>15.8 %</td><td>4.00 mm</td>"), std::string::npos);
}

// One E of a law that the stuff has not is no answer that palpate has to give; the page tells both, and which one counts.
TEST(PaperScores, ALawThatPalpateFitsAsWellCounts) {
  TrialAnswer foam = trial(13e3, answer(11.5e3, 11e3, 12e3, 90));
  foam.other_law = "foam";
  foam.other = answer(10.2e3, 9.8e3, 11e3, 70);
  const SceneScores scores = scores_of({foam});
  EXPECT_NEAR(scores.palpate.bias_percent, 100 * std::log(1.02), 1e-9);
  EXPECT_EQ(scores.palpate.inside_95, 1);
  EXPECT_NEAR(scores.palpate_compared.rms_percent, 100 * std::log(1.02), 1e-9);
  EXPECT_EQ(scores.palpate.most_load_cases, 160) << "the samples are those that the other law left";
  EXPECT_NEAR(scores.palpate_with_the_papers_law.bias_percent, 100 * std::log(1.15), 1e-9);
  EXPECT_EQ(scores.palpate_with_the_papers_law.inside_95, 0);
  const std::string table = score_table(scene("foam9cm", {foam}));
  EXPECT_NE(table.find("palpate with the foam law, which counts"), std::string::npos);
  EXPECT_NE(table.find("palpate with the law of the paper's method"), std::string::npos);
  for (const std::size_t claim : {0u, 1u, 2u})
    EXPECT_NE(claims_of({scene("foam9cm", {foam})}).at(claim).found.find("palpate with the foam law in foam9cm"), std::string::npos);
}

TEST(PaperClaims, WithoutAnIntervalATruthIsNotInside) {
  const TrialAnswer good = trial(13e3, answer(10.4e3, 9.8e3, 11e3, 90)), bare = trial(13e3, answer(10.4e3, nan, nan, 90));
  EXPECT_TRUE(claims_of({scene("cube", {good, good})}).at(2).holds);
  EXPECT_FALSE(claims_of({scene("cube", {good, bare})}).at(2).holds);
  EXPECT_FALSE(claims_of({scene("cube", {good, trial(13e3, no_answer())})}).at(2).holds);
  EXPECT_NE(score_table(scene("cube", {good, bare})).find("<td>1 of 2</td>"), std::string::npos);
}

// On an object with regions palpate solves once for all sites, the paper's method for each.
TEST(PaperClaims, SolvesOfAllSitesAreOneSeeds) {
  TrialAnswer bear = trial(13e3, answer(10.4e3, 9.8e3, 11e3, 250));
  for (const char* site : {"head", "belly", "back"})
    bear.sites.push_back({site, 10e3, answer(13e3, nan, nan, 450), answer(10.4e3, 9.8e3, 11e3, 250)});
  const SceneScores scores = scores_of({bear});
  EXPECT_EQ(scores.paper.solves, 1350);
  EXPECT_EQ(scores.palpate.solves, 250);
  EXPECT_EQ(scores.paper.asked, 3);
  EXPECT_TRUE(claims_of({scene("teddy", {bear})}).at(3).holds);
}

TEST(PaperClaims, LeaveOutWhatHasNoTruth) {
  const SceneAnswers balloon = scene("balloon", {trial(13e3, answer(99e3, 98e3, 100e3, 5000))});
  EXPECT_TRUE(claims_of({balloon}).empty());
  for (const Claim& claim : claims_of({balloon, scene("cube", {trial(13e3, answer(10.4e3, 9.8e3, 11e3, 90))})})) EXPECT_TRUE(claim.holds);
  const std::string page = paper_page({balloon}, {}, "0.1.0", "command", {1});
  EXPECT_EQ(page.find("true E"), std::string::npos);
  EXPECT_NE(page.find("An apparent modulus has no truth"), std::string::npos);
  const auto json = json_of(balloon);
  EXPECT_FALSE(json.contains("scores"));
  EXPECT_FALSE(json.at("trials").at(0).contains("true_young_modulus_pa"));
}

TEST(PaperPage, SaysWhereAStudysIntervalMisses) {
  const Study& study = studies().front();
  const MethodAnswer right = answer(10.4e3, 9.8e3, 11e3, 90), wrong = answer(12e3, 11e3, 13e3, 90);
  const auto cells = [&](const MethodAnswer& palpate) { return study_table({&study, 1, {{"row", 10e3, 0.3, answer(13e3, nan, nan, 9), palpate}}, {}, 0}); };
  EXPECT_NE(cells(right).find(">yes<"), std::string::npos);
  EXPECT_EQ(cells(right).find("<b>no</b>"), std::string::npos);
  EXPECT_NE(cells(wrong).find("<b>no</b>"), std::string::npos);
  EXPECT_NE(cells(wrong).find("(+20 %)"), std::string::npos);
  EXPECT_EQ(cells(no_answer()).find(">yes<"), std::string::npos);
  EXPECT_NE(cells(right).find("<td>none</td></tr>"), std::string::npos) << "no verdicts is said";
}

TEST(PaperPage, ScoresAStudyOverItsSeeds) {
  const Study& study = studies().front();
  const auto seed = [&](std::uint64_t number, double paper_pa, MethodAnswer palpate, std::vector<std::string> verdicts) {
    palpate.verdicts = std::move(verdicts);
    return StudyAnswer{&study, number, {{"one", 10e3, 0.3, answer(paper_pa, nan, nan, 9), palpate}, {"another", 10e3, 0.3, answer(10e3, nan, nan, 9), no_answer()}}, {}, 0};
  };
  const std::vector<StudyAnswer> seeds{seed(1, 10e3 * std::exp(0.3), answer(10.4e3, 9.8e3, 11e3, 90), {"a", "a"}),
                                       seed(2, 10e3 * std::exp(-0.4), answer(12e3, 11e3, 13e3, 90), {"a", "b"})};
  const auto scores = scores_of(std::span(seeds));
  ASSERT_EQ(scores.size(), 2u);
  EXPECT_NEAR(scores[0].paper.rms_percent, std::sqrt(0.5 * (30 * 30 + 40 * 40)), 1e-9);
  EXPECT_NEAR(scores[0].paper.bias_percent, -5, 1e-9);
  EXPECT_EQ(scores[0].palpate.inside_95, 1);
  EXPECT_EQ(scores[0].palpate.asked, 2);
  EXPECT_EQ(scores[0].verdicts, (std::map<std::string, int>{{"a", 2}, {"b", 1}}));
  EXPECT_EQ(scores[1].palpate.asked, 0) << "palpate was not asked";
  EXPECT_NE(study_score_table(seeds).find("<td>1 of 2</td>"), std::string::npos);
  EXPECT_EQ(study_score_table(std::span(seeds).first(1)), "");
}

TEST(PaperPage, NamesAVerdictOnceAndCountsIt) {
  EXPECT_EQ(listed({}), "none");
  EXPECT_EQ(listed({"b", "a", "b", "c", "b"}), "b (3 times), a, c");
}

TEST(PaperPage, HasARowForEverySceneAndForEverySeed) {
  const TrialAnswer first = trial(13e3, answer(10.4e3, 9.8e3, 11e3, 90)), second = trial(7e3, answer(9.6e3, 9e3, 9.9e3, 90));
  const std::string overview = overview_table({scene("cube", {first, second}), scene("balloon", {first})});
  EXPECT_NE(overview.find(">cube</a> (fig. 5, 6)"), std::string::npos);
  EXPECT_NE(overview.find("Force over travel is nearly straight"), std::string::npos);
  EXPECT_NE(overview.find("<td>1 of 2</td>"), std::string::npos) << "of two truths one is inside";
  EXPECT_NE(overview.find("13.0 kPa, apparent"), std::string::npos) << overview;
  const std::string seeds = seed_table(scene("cube", {first, second}));
  EXPECT_NE(seeds.find("13.0 kPa (+30 %)"), std::string::npos) << seeds;
  EXPECT_NE(seeds.find("7.00 kPa (-30 %)"), std::string::npos) << seeds;
  EXPECT_EQ(seed_table(scene("balloon", {first})).find("true E"), std::string::npos);
}

// 10 and 12 kPa at one site, 20 and 22 at the other: 1.41 within each, means of 11 and 21, 7.07 apart as standard deviation.
TEST(PaperPage, TellsSpreadWithinSitesFromSpreadBetween) {
  TrialAnswer bear = trial(13e3, answer(10.4e3, 9.8e3, 11e3, 90));
  for (const char* site : {"head", "back"}) bear.sites.push_back({site, 10e3, answer(13e3, nan, nan, 450), answer(10.4e3, 9.8e3, 11e3, 250)});
  for (const auto& [push, young_pa] : {std::pair{"push 1", 10e3}, {"push 1", 12e3}, {"push 2", 20e3}, {"push 2", 22e3}})
    bear.samples.push_back({push, 1, 0.001, answer(young_pa, nan, nan, 9), answer(15e3, nan, nan, 9)});
  const std::string table = site_table(bear);
  EXPECT_NE(table.find("<td>head</td><td>2</td><td>11.0 kPa &plusmn; 12.9 %</td><td>15.0 kPa &plusmn; 0.0 %</td>"), std::string::npos) << table;
  EXPECT_NE(table.find("within a site, root mean square</td><td></td><td>8.8 %</td><td>0.0 %</td>"), std::string::npos) << table;
  EXPECT_NE(table.find("between the means of the sites</td><td></td><td>44.2 %</td><td>0.0 %</td>"), std::string::npos) << table;
}

TEST(PaperPage, NamesAndMarksTheLowestPointOfTheGrid) {
  TrialAnswer one = trial(13e3, answer(10.4e3, 9.8e3, 11e3, 90));
  one.surface.young_modulus_pa = VectorX::LinSpaced(3, 8e3, 16e3);
  one.surface.poisson_ratio = VectorX::LinSpaced(2, 0.1, 0.4);
  one.surface.error_m2 = MatrixX::Constant(3, 2, 4e-6);
  one.surface.error_m2(1, 1) = 1e-6;
  one.surface.at_found_m2 = 2e-6;
  const std::string page = paper_page({scene("cube", {one})}, {}, "0.1.0", "command", {1});
  EXPECT_NE(page.find("at E = 12.0 kPa and &nu; = 0.400"), std::string::npos);
  EXPECT_NE(page.find("lowest of the grid"), std::string::npos);
  EXPECT_EQ(json_of(scene("cube", {one})).at("trials").at(0).at("grid_search").at("smallest_at").at("young_modulus_pa"), 12e3);
}

TEST(PaperPage, OfAnApparentModulusAllThreeFitsAreThere) {
  const TrialAnswer one = trial(13e3, answer(99e3, 98e3, 100e3, 70));
  const std::string table = score_table(scene("balloon", {one, one}));
  EXPECT_NE(table.find("linear tetrahedra</td><td>13.0 kPa &plusmn; 0.0 %</td>"), std::string::npos) << table;
  EXPECT_NE(table.find("Seeds share what was solved for"), std::string::npos);
}

TEST(PaperPage, WithoutAnAnswerItSaysSo) {
  TrialAnswer none = trial(13e3, no_answer());
  none.unused.push_back({2.0, 0.004, {2.2, 1e-4}, {nan, nan}, {nan, nan}, 2e-3});
  const std::string page = paper_page({scene("cube", {none})}, {}, "0.1.0", "command", {1});
  EXPECT_NE(page.find("palpate found no answer"), std::string::npos);
  EXPECT_NE(page.find("<td>2.20 N (+10 %)</td><td>none</td>"), std::string::npos);
  EXPECT_EQ(page.find("nan"), std::string::npos);
}

}  // namespace
}  // namespace palpate::cli::paper_page_test
