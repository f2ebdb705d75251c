// label: oracle
// SPDX-License-Identifier: Apache-2.0
// A short coverage table, in every run of the tests: 201 recordings a row over three scenes, one or two seconds each. The whole one is
// coverage_test.cpp; rows whose contacts are found anew cost ten times as much.
#include "estimation/coverage_table.hpp"

namespace palpate::coverage::coverage_short_test {
namespace {

void intervals_hold(const std::string& scene) {
  TableOptions options;
  options.rows = {"clean", "outliers", "tare", "pose", "rest", "correlated"};
  options.scenes = {scene};
  options.seeds = 67;
  options.first_seed = 3001;
  options.bound_of_correlated = false;
  Table(options).run();
}

TEST(ShortCoverage, OfACube) { intervals_hold("cube_top"); }
TEST(ShortCoverage, OfABall) { intervals_hold("ball_top"); }
TEST(ShortCoverage, OfABar) { intervals_hold("bar_oblique"); }

}  // namespace
}  // namespace palpate::coverage::coverage_short_test
