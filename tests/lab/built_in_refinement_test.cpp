// label: statistics
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/lab/built_in.hpp"

namespace palpate::lab::built_in_refinement_test {
namespace {

// The demo's own error must be at most a fifth of the 1.5 % that the estimator states of its E: travel goes with 1/E. Near the end of
// the range that nu is drawn from, too, where volume counts most.
TEST(BuiltIn, RefinementMovesTheTruthLittle) {
  DemoOptions options;
  options.sites_m = {0.0};
  options.material = "linear";  // one solve a mesh
  options.young_modulus_pa = 15e3;
  options.levels = 1;
  options.depth_m = 0.005;
  for (const double poisson : {0.3, 0.45}) {
    options.poisson_ratio = poisson;
    const auto travel_with = [&](int cells) {
      options.cells_in_radius = cells;
      return make_demo(options).truth.travel_m[0][1];
    };
    const double usual = travel_with(DemoOptions{}.cells_in_radius), fine = travel_with(2 * DemoOptions{}.cells_in_radius);
    EXPECT_LT(std::abs(usual / fine - 1), 0.003) << "nu " << poisson << ": " << 1e3 * usual << " and " << 1e3 * fine << " mm";
    EXPECT_NE(usual, fine);
  }
}

}  // namespace
}  // namespace palpate::lab::built_in_refinement_test
