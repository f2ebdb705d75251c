// label: statistics
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "palpate/lab/built_in.hpp"

namespace palpate::lab {
namespace {

// The lab's own error must be small against what the estimator states (about 1 % in E): travel goes with 1/E.
TEST(BuiltIn, RefinementMovesTheTruthLittle) {
  DemoOptions options;
  options.sites_m = {0.0};
  options.young_modulus_pa = 15e3;
  options.poisson_ratio = 0.3;
  options.levels = 1;
  options.depth_m = 0.005;
  std::vector<double> travel;
  for (const int cells : {1, 2, 3}) {
    options.cells_in_radius = cells;
    travel.push_back(make_demo(options).truth.travel_m[0][1]);
  }
  RecordProperty("travel_1_mm", std::to_string(1e3 * travel[0]));
  RecordProperty("travel_2_mm", std::to_string(1e3 * travel[1]));
  RecordProperty("travel_3_mm", std::to_string(1e3 * travel[2]));
  EXPECT_LT(std::abs(travel[1] / travel[2] - 1), 0.004);
  EXPECT_LT(std::abs(travel[1] - travel[2]), std::abs(travel[0] - travel[2]));
}

}  // namespace
}  // namespace palpate::lab
