// label: oracle
// SPDX-License-Identifier: Apache-2.0
// A short coverage table, in every run of the tests: 200 recordings a row, where one costs little. The whole one is
// coverage_test.cpp; rows whose contacts are found anew cost minutes a recording.
#include "estimation/coverage_table.hpp"

namespace palpate::coverage {
namespace {

TEST(ShortCoverage, IntervalsHoldTheTruthAsOftenAsTheySay) {
  TableOptions options;
  options.rows = {"clean", "outliers", "tare", "pose", "rest", "correlated"};
  options.scenes = {"cube_top", "bar_oblique"};
  options.seeds = 100;
  options.first_seed = 3001;
  Table(options).run();
}

}  // namespace
}  // namespace palpate::coverage
