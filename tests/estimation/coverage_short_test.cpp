// label: oracle
// SPDX-License-Identifier: Apache-2.0
// A short coverage table, in every run of the tests: 200 recordings a row, most of them where one costs least. The whole one is
// coverage_test.cpp; rows whose contacts are found anew cost minutes a recording.
#include "estimation/coverage_table.hpp"

namespace palpate::coverage {
namespace {

void intervals_hold(const std::string& scene, int seeds) {
  TableOptions options;
  options.rows = {"clean", "outliers", "tare", "pose", "rest", "correlated"};
  options.scenes = {scene};
  options.seeds = seeds;
  options.first_seed = 3001;
  options.bound_of_correlated = false;
  Table(options).run();
}

TEST(ShortCoverage, OfACube) { intervals_hold("cube_top", 150); }
TEST(ShortCoverage, OfABar) { intervals_hold("bar_oblique", 50); }

}  // namespace
}  // namespace palpate::coverage
