// label: unit
// SPDX-License-Identifier: Apache-2.0
// Runs of `palpate paper` with work that takes no time: what is stopped goes on, pieces make the whole, what fails is a row.
#include "cli/paper_run.hpp"
#include "cli/paper_truths.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <barrier>
#include <filesystem>
#include <fstream>
#include <limits>
#include <mutex>
#include <set>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "palpate/core/error.hpp"

#include "refusals.hpp"
#include "temporary_folder.hpp"

namespace palpate::cli::paper_run_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

std::string contents(const fs::path& file) {
  std::stringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}
std::string page_of(const fs::path& out) { return contents(out / "paper.json") + contents(out / "paper.html"); }

MethodAnswer answer(double young_pa, double nu) {
  MethodAnswer out = no_answer();
  out.young_modulus_pa = young_pa;
  out.poisson_ratio = nu;
  out.solves = 500;
  out.load_cases = 90;
  out.seconds = 0.1;  // no number of the binary system: it must come back all the same
  out.converged = true;
  out.path = {{1e4, 0.3, 7, 1}, {1.1e4, 0.25, 5, 1}};
  out.verdicts = {"nu_not_determined"};
  return out;
}

/// All that a trial may hold, different for every seed.
void make_up(std::uint64_t seed, const TrialOptions& options, TrialAnswer& out) {
  const double s = static_cast<double>(seed);
  out.young_modulus_pa = 1e4 + s / 3;
  out.poisson_ratio = 0.3;
  out.tetrahedra = 4000;
  out.truth_s = s / 7;
  out.total_s = 3 + s;
  out.paper = answer(1.2e4 + s, 0.2);
  out.palpate = answer(1.01e4 + s, 0.29);
  out.palpate.lower_95_pa = 0.9e4, out.palpate.upper_95_pa = 1.1e4;
  out.paper_coarse = answer(0.9e4, 0.1);
  out.readings = {{"push 1", 1 / 3.0, 0.001}, {"push 1", 2, std::numeric_limits<double>::quiet_NaN()}};
  out.unused = {{2, 0.004, {2.2, 1e-4}, {2.1, 1e-4}, {no_value, no_value}, 2e-3}};
  if (!options.pictures) return;
  out.samples = {{"push 1", 1, 0.001, answer(1.3e4, 0.1), answer(1e4, 0.3)}, {"push 1", 2, 0.002, no_answer(), answer(1e4, 0.3)}};
  out.pictures = {{3e4, 1e-3, Points::Random(5, 3), Points::Random(4, 3)}};
  out.pictures[0].simulated_m << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1;
  out.pictures[0].registered_m << 0, 0, 0.1, 1, 0, 0.1, 0, 1, 0.1, 0, 0, 0.9;
  out.surface.young_modulus_pa = VectorX::LinSpaced(3, 5e3, 2e4);
  out.surface.poisson_ratio = VectorX::LinSpaced(2, 0.1, 0.4);
  out.surface.error_m2.resize(3, 2);
  out.surface.error_m2 << 3e-6, std::numeric_limits<double>::infinity(), 1e-6, 2e-6, 4e-6, 5e-6;
  out.surface.at_found_m2 = 1e-6;
}

std::vector<StudyRow> one_row() { return {{"row", 1e4, 0.3, answer(1.1e4, 0.2), answer(1e4, 0.3)}}; }

struct MadeUp {
  PaperPlan plan;
  PaperWork work;
  int made = 0, stops_after = 1000;
  std::vector<std::string> said;

  MadeUp() {
    plan.scenes = {&lab::paper_scene("cow"), &lab::paper_scene("cube")};
    plan.studies = {&studies().front()};
    plan.seeds = 4;
    work.trial = [this](const lab::PaperScene&, std::uint64_t seed, const TrialOptions& options, SharedModels*, TrialAnswer& out) {
      ++made;
      make_up(seed, options, out);
    };
    work.study = [this](const Study&, const StudyOptions&, StudyAnswer& out) {
      ++made;
      out.rows = one_row();
    };
    work.stopped = [this] { return made >= stops_after; };
    work.say = [this](const std::string& line) { said.push_back(line); };
  }
};

TEST(PaperRun, WhatWasStoppedGoesOnToTheSamePage) {
  const test::TemporaryFolder files("paper_run");
  MadeUp whole;
  run_plan(whole.plan, whole.work, files / "whole");
  EXPECT_EQ(whole.made, 9);

  MadeUp first;
  first.stops_after = 3;  // in the midst of the third seed
  run_plan(first.plan, first.work, files / "parts");
  EXPECT_NE(page_of(files / "parts"), page_of(files / "whole"));
  MadeUp again;
  again.plan = first.plan;
  run_plan(again.plan, again.work, files / "parts");
  EXPECT_EQ(again.made, 7) << "two seeds were there";
  EXPECT_EQ(page_of(files / "parts"), page_of(files / "whole"));
  EXPECT_THAT(contents(files / "whole" / "paper.html"), HasSubstr("<svg"));
  MadeUp nothing;
  run_plan(nothing.plan, nothing.work, files / "parts");
  EXPECT_EQ(nothing.made, 0);
  EXPECT_EQ(page_of(files / "parts"), page_of(files / "whole"));
}

TEST(PaperRun, QuickModeTakesWhatThePaperHas) {
  PaperPlan plan;
  plan.details_of = 1;
  plan.quick = true;
  const auto& cow = lab::paper_scene("cow");
  const auto& cube = lab::paper_scene("cube");
  EXPECT_TRUE(options_of(plan, cow, 1).other_starts) << "fig. 4";
  EXPECT_FALSE(options_of(plan, cow, 1).samples_alone);
  EXPECT_TRUE(options_of(plan, cube, 1).samples_alone) << "fig. 6";
  EXPECT_FALSE(options_of(plan, cube, 1).other_starts);
  EXPECT_FALSE(options_of(plan, cube, 2).samples_alone) << "a seed without details";
  EXPECT_TRUE(options_of(plan, cube, 1).coarse && options_of(plan, cube, 2).coarse);
  plan.quick = false;
  for (const lab::PaperScene& scene : lab::paper_scenes()) {
    EXPECT_FALSE(options_of(plan, scene, 1).coarse) << scene.name;
    EXPECT_TRUE(options_of(plan, scene, 1).other_starts) << scene.name;
    EXPECT_TRUE(options_of(plan, scene, 1).samples_alone) << scene.name;
  }
}

TEST(PaperRun, ScenesSideBySideMakeTheSamePage) {
  const test::TemporaryFolder files("paper_side_by_side");
  MadeUp whole;
  run_plan(whole.plan, whole.work, files / "whole");
  // Cow, cube and study wait for each other: that they meet shows that they run at the same time.
  MadeUp run;
  run.plan.side_by_side = 3;
  std::barrier all(3);
  std::set<std::thread::id> threads;
  std::mutex mutex;
  const auto note = [&] {
    const std::scoped_lock lock(mutex);
    ++run.made;
    threads.insert(std::this_thread::get_id());
  };
  run.work.trial = [&](const lab::PaperScene&, std::uint64_t seed, const TrialOptions& options, SharedModels*, TrialAnswer& out) {
    if (seed == 1) all.arrive_and_wait();
    note();
    make_up(seed, options, out);
  };
  run.work.study = [&](const Study&, const StudyOptions&, StudyAnswer& out) {
    all.arrive_and_wait();
    note();
    out.rows = one_row();
  };
  run.work.stopped = [] { return false; };
  run_plan(run.plan, run.work, files / "out");
  EXPECT_EQ(run.made, 9);
  EXPECT_EQ(threads.size(), 3u);
  EXPECT_EQ(page_of(files / "out"), page_of(files / "whole"));

  // What cannot be written ends the run with its error, from whatever thread.
  MadeUp nowhere;
  nowhere.plan.side_by_side = 3;
  nowhere.work.stopped = [] { return false; };
  nowhere.work.trial = [](const lab::PaperScene&, std::uint64_t seed, const TrialOptions& options, SharedModels*, TrialAnswer& out) {
    make_up(seed, options, out);
  };
  nowhere.work.study = [](const Study&, const StudyOptions&, StudyAnswer&) {};
  nowhere.work.say = [](const std::string&) { throw Error("is full", "the disk"); };
  EXPECT_THAT(message_of([&] { run_plan(nowhere.plan, nowhere.work, files / "nowhere"); }), HasSubstr("is full"));
}

TEST(PaperRun, PiecesJoinedAreTheWhole) {
  const test::TemporaryFolder files("paper_pieces");
  MadeUp whole;
  run_plan(whole.plan, whole.work, files / "whole");
  MadeUp one, two;
  one.plan.seeds = 1;
  two.plan.first_seed = 2;
  two.plan.seeds = 3;
  two.plan.studies.clear();
  run_plan(one.plan, one.work, files / "one");
  run_plan(two.plan, two.work, files / "two");
  EXPECT_THAT(contents(files / "two" / "paper.html"), Not(HasSubstr("E from samples alone"))) << "these belong to the first seed of all";
  const SeedFolder joined(files / "joined");
  joined.take_from(files / "two");
  joined.take_from(files / "one");
  joined.take_from(files / "one");  // the same again is the same
  write_page(joined.collect(), files / "joined");
  EXPECT_EQ(page_of(files / "joined"), page_of(files / "whole"));
  EXPECT_THAT(contents(files / "joined" / "paper.html"), HasSubstr("E from samples alone"));

  MadeUp other;
  other.plan.seeds = 1;
  other.work.trial = [](const lab::PaperScene&, std::uint64_t, const TrialOptions& options, SharedModels*, TrialAnswer& out) { make_up(9, options, out); };
  run_plan(other.plan, other.work, files / "other");
  EXPECT_THAT(message_of([&] { joined.take_from(files / "other"); }), HasSubstr("another answer"));
  EXPECT_THAT(message_of([&] { joined.take_from(files / "nothing"); }), HasSubstr("holds no seeds"));

  // Of another program: nothing of it is taken, and the file that was given is named.
  fs::create_directories(files / "old" / "seeds");
  std::ofstream(files / "old" / "seeds" / "cube_0001.json") << R"({"palpate": "0.0.1", "format": 1})";
  const SeedFolder empty(files / "empty");
  EXPECT_THAT(message_of([&] { empty.take_from(files / "old"); }), HasSubstr((files / "old" / "seeds" / "cube_0001.json").string()));
  EXPECT_FALSE(fs::exists(files / "empty"));
}

TEST(PaperRun, SeedsKeptALineEachAreTheSame) {
  const test::TemporaryFolder files("paper_lines");
  MadeUp whole;
  run_plan(whole.plan, whole.work, files / "whole");
  fs::create_directories(files / "kept" / "seeds");
  std::string lines;
  for (const auto& entry : fs::directory_iterator(files / "whole" / "seeds")) lines += contents(entry.path());
  const fs::path kept = files / "kept" / "seeds" / "all.jsonl";
  std::ofstream(kept) << lines;
  const SeedFolder joined(files / "joined");
  joined.take_from(files / "kept");
  joined.take_from(files / "whole");  // the same again is the same
  write_page(joined.collect(), files / "joined");
  EXPECT_EQ(page_of(files / "joined"), page_of(files / "whole"));

  // Of another version, they are a page of that version, and nothing is added to them.
  std::string older = lines;
  for (std::size_t at = 0; (at = older.find("\"palpate\":\"0.", at)) != std::string::npos; ++at) older.replace(at, 13, "\"palpate\":\"7.");
  ASSERT_NE(older, lines);
  std::ofstream(kept) << older;
  const SeedFolder of_other(files / "other");
  of_other.take_from(files / "kept");
  write_page(of_other.collect(), files / "other");
  EXPECT_THAT(contents(files / "other" / "paper.html"), HasSubstr("made again by palpate 7."));
  EXPECT_THAT(message_of([&] { run_plan(whole.plan, whole.work, files / "other"); }), HasSubstr("holds seeds of palpate 7."));
  of_other.take_from(files / "kept");
  EXPECT_THAT(message_of([&] { of_other.take_from(files / "whole"); }), HasSubstr("another answer"));

  std::ofstream(kept) << lines.substr(0, lines.size() - 100);
  EXPECT_THAT(message_of([&] { SeedFolder(files / "cut").take_from(files / "kept"); }), HasSubstr("all.jsonl, line 9: is no seed"));
  EXPECT_FALSE(fs::exists(files / "cut"));
}

TEST(PaperRun, TrueStatesAreFilesThatMayBeDamaged) {
  const test::TemporaryFolder files("paper_truths");
  const lab::PressedMemory::Store store = truths_in(files / "truths");
  EXPECT_FALSE(store.load("block 0.1"));
  const MatrixX states = MatrixX::Random(3, 8) / 3;
  store.keep("block 0.1", states);
  EXPECT_EQ(store.load("block 0.1").value(), states) << "to the last digit";
  EXPECT_FALSE(store.load("block 0.2"));
  const fs::path file = files / "truths" / "block_0.1.npy";
  fs::resize_file(file, fs::file_size(file) - 8);
  EXPECT_FALSE(store.load("block 0.1")) << "cut off";
  store.keep("block 0.1", states);
  EXPECT_TRUE(store.load("block 0.1"));
}

TEST(PaperRun, AFailedSeedIsARowAndTheRunGoesOn) {
  const test::TemporaryFolder files("paper_failed");
  MadeUp run;
  run.work.trial = [&](const lab::PaperScene& scene, std::uint64_t seed, const TrialOptions& options, SharedModels*, TrialAnswer& out) {
    ++run.made;
    if (scene.name == "cube" && seed == 2) throw std::runtime_error("the pad went <through> it");
    make_up(seed, options, out);
  };
  run.work.study = [&](const Study&, const StudyOptions&, StudyAnswer&) { throw std::runtime_error("no such mesh"); };
  const PaperRuns runs = run_plan(run.plan, run.work, files / "out");
  EXPECT_EQ(run.made, 8);
  ASSERT_EQ(runs.scenes.size(), 2u);
  ASSERT_EQ(runs.scenes[1].trials.size(), 4u);
  EXPECT_EQ(runs.scenes[1].trials[1].failed, "the pad went <through> it");
  const std::string page = contents(files / "out" / "paper.html");
  EXPECT_THAT(page, HasSubstr("the pad went &lt;through&gt; it"));
  EXPECT_THAT(page, HasSubstr("no such mesh"));
  const auto told = nlohmann::json::parse(contents(files / "out" / "paper.json"));
  EXPECT_EQ(told.at("scenes").at(1).at("trials").at(1).at("failed"), "the pad went <through> it");
}

TEST(PaperRun, AStudyThatIsAskedForSeveralSeedsIsToldOverThem) {
  const test::TemporaryFolder files("paper_study_seeds");
  MadeUp run;
  run.plan.scenes.clear();
  run.plan.study_seed = 5;
  run.plan.study_seeds = 3;
  run.plan.details_of = 7;
  run.work.study = [&](const Study&, const StudyOptions& options, StudyAnswer& out) {
    ++run.made;
    if (options.seed == 6) throw std::runtime_error("no <such> mesh");
    out.rows = one_row();
    out.rows[0].palpate.verdicts = {"contact_slipped", "contact_slipped"};
    if (options.pictures) out.rows[0].views = {{"Four <views>", 1, 1, "cGljdHVyZQ" + std::to_string(options.seed)}};
  };
  const PaperRuns runs = run_plan(run.plan, run.work, files / "out");
  EXPECT_EQ(run.made, 3);
  ASSERT_EQ(runs.studies.size(), 3u);
  EXPECT_THAT(runs.command(), HasSubstr("--seed 5 --seeds 3"));
  const std::string page = contents(files / "out" / "paper.html");
  EXPECT_THAT(page, HasSubstr("contact_slipped (2)"));
  EXPECT_THAT(page, HasSubstr("Seed 6 ended with an error: no &lt;such&gt; mesh"));
  EXPECT_THAT(page, HasSubstr("cGljdHVyZQ7"));
  EXPECT_THAT(page, Not(HasSubstr("cGljdHVyZQ5"))) << "pictures of one seed, as with scenes";
  EXPECT_EQ(page.find("<h2"), page.rfind("<h2")) << "one section for all of its seeds";
  const auto told = nlohmann::json::parse(contents(files / "out" / "paper.json")).at("study_scores").at(0);
  EXPECT_EQ(told.at("seeds"), 3);
  EXPECT_EQ(told.at("rows").at(0).at("paper").at("asked"), 2);

  MadeUp again;
  again.plan = run.plan;
  run_plan(again.plan, again.work, files / "out");
  EXPECT_EQ(again.made, 0);
}

TEST(PaperRun, QuickSeedsAreToldAndNotCountedWithOthers) {
  const test::TemporaryFolder files("paper_quick");
  MadeUp quick;
  quick.plan.quick = true;
  quick.plan.seeds = 1;
  run_plan(quick.plan, quick.work, files / "quick");
  EXPECT_THAT(contents(files / "quick" / "paper.html"), HasSubstr("A quick look"));
  EXPECT_THAT(contents(files / "quick" / "paper.json"), HasSubstr("paper -o OUT --quick"));
  MadeUp more;
  more.plan.first_seed = 2;
  more.plan.seeds = 1;
  more.plan.details_of = 0;
  more.plan.studies.clear();
  run_plan(more.plan, more.work, files / "whole");
  EXPECT_THAT(contents(files / "whole" / "paper.html"), Not(HasSubstr("A quick look")));
  const SeedFolder joined(files / "quick");
  joined.take_from(files / "whole");
  EXPECT_THAT(message_of([&] { joined.collect(); }), HasSubstr("cow_0002.json: was made without --quick, others with it"));
}

TEST(PaperRun, SeedsOfOtherOptionsAreRefusedByName) {
  const test::TemporaryFolder files("paper_options");
  MadeUp run;
  run.plan.seeds = 2;
  run_plan(run.plan, run.work, files / "out");
  const auto refused = [&](auto change) {
    MadeUp other;
    other.plan.seeds = 2;
    change(other.plan);
    const std::string message = message_of([&] { run_plan(other.plan, other.work, files / "out"); });
    EXPECT_EQ(other.made, 0);
    return message;
  };
  EXPECT_EQ(refused([](PaperPlan& plan) { plan.threads = 2; }), "nothing thrown") << "seconds alone change";
  EXPECT_THAT(refused([](PaperPlan& plan) { plan.quick = true; }), HasSubstr("cow_0001.json: was made with other options"));
  EXPECT_THAT(refused([](PaperPlan& plan) { plan.details_of = 2; }), HasSubstr("--details-of"));
  EXPECT_THAT(refused([](PaperPlan& plan) { plan.object = {"spot.obj", "abc", "y", 0.28}; }), HasSubstr("--object"));

  std::string seed = contents(files / "out" / "seeds" / "cube_0002.json");
  const auto with = [&](const std::string& bytes) {
    std::ofstream(files / "out" / "seeds" / "cube_0002.json") << bytes;
    return refused([](PaperPlan&) {});
  };
  EXPECT_THAT(with(seed.substr(0, seed.size() / 2)), HasSubstr("cube_0002.json: is no seed of palpate paper, or damaged"));
  std::string without = seed;
  without.replace(without.find("tetrahedra\""), 10, "hexahedra_");
  EXPECT_THAT(with(without), HasSubstr("is damaged"));
  seed.replace(seed.find("\"palpate\":\"") + 11, 1, "9");
  EXPECT_THAT(with(seed), HasSubstr("different programs"));
}

}  // namespace
}  // namespace palpate::cli::paper_run_test
