// label: statistics
// SPDX-License-Identifier: Apache-2.0
// How often the intervals hold the truth, how far off the answers are, and how near they come to the Cramer-Rao bound: the table
// of docs/uncertainty.md. A few recordings a row by default;
//   PALPATE_SEEDS=400 PALPATE_CALCULIX_EACH=5 PALPATE_OUTCOMES=FILE estimation_coverage_test
// for figures that mean something: 1600 recordings a row over all scenes, the truths of every fifth by CalculiX. FILE keeps what was
// done: a run that was stopped goes on, and runs of PALPATE_ROW=pose,rest or PALPATE_SCENE=ball_top come together. PALPATE_FIRST_SEED to
// go on elsewhere, PALPATE_EACH=1 for a line a recording, PALPATE_NOISELESS=1 for what meshes alone do, PALPATE_TRUE_TETRAHEDRA and
// PALPATE_FINE for the truth's mesh.
#include <gtest/gtest.h>

#include <cstdlib>
#include <sstream>

#include "estimation/coverage_table.hpp"

namespace palpate::coverage::coverage_test {
namespace {

int number(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text ? std::max(0, std::atoi(text)) : otherwise;
}

std::vector<std::string> names(const char* name) {
  const char* text = std::getenv(name);
  std::istringstream given(text ? text : "");
  std::vector<std::string> out;
  for (std::string one; std::getline(given, one, ',');) out.push_back(one);
  return out;
}

TEST(Coverage, IntervalsHoldTheTruthAsOftenAsTheySay) {
  TableOptions options;
  options.seeds = number("PALPATE_SEEDS", options.seeds);
  options.first_seed = number("PALPATE_FIRST_SEED", options.first_seed);
  options.scenes = names("PALPATE_SCENE");
  options.rows = names("PALPATE_ROW");
  options.fine = number("PALPATE_FINE", options.fine);
  options.true_tetrahedra = number("PALPATE_TRUE_TETRAHEDRA", 0);
  options.calculix_each = number("PALPATE_CALCULIX_EACH", 0);
  options.each = std::getenv("PALPATE_EACH") != nullptr;
  options.noiseless = std::getenv("PALPATE_NOISELESS") != nullptr;
  if (const char* file = std::getenv("PALPATE_OUTCOMES")) options.outcomes = file;
  if (options.calculix_each > 0 && !fem::calculix_is_there()) GTEST_SKIP() << "CalculiX (ccx) is not installed";
  Table(options).run();
}

}  // namespace
}  // namespace palpate::coverage::coverage_test
