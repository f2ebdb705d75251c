// label: statistics
// SPDX-License-Identifier: Apache-2.0
// How far the lab's own mesh moves the truth: travel goes with 1/E. docs/lab.md holds the figures.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "palpate/lab/object.hpp"

namespace palpate::lab {
namespace {

struct Case {
  std::string name, object;
  double most = 0.004;  ///< a fifth of what the estimator states of E (docs/uncertainty.md): 2 % unless said otherwise
  double region_ratio = 1;
};
void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

class Refinement : public testing::TestWithParam<Case> {};

TEST_P(Refinement, MovesTheTruthLittle) {
  ObjectOptions options;
  options.material = "linear";  // one solve a mesh; the error of the mesh is that of small strains
  options.young_modulus_pa = 15e3;
  options.poisson_ratio = 0.3;
  options.region_ratio = GetParam().region_ratio;
  const auto travel_of = [&](Index tetrahedra, int cells, std::size_t site) {
    options.tetrahedra = tetrahedra;
    options.cells_in_radius = cells;
    const LabObject object = make_object(GetParam().object, options);
    const auto pressed = object.press(object.sites[site]);
    pressed->press(1.0);
    std::printf("%s %s: %d nodes, %.5f mm per N\n", GetParam().name.c_str(), object.sites[site].name.c_str(), int(pressed->nodes()),
                1e3 * pressed->travel_m());
    return pressed->travel_m();
  };
  for (std::size_t site = 0; site < make_object(GetParam().object, options).sites.size(); ++site) {
    const double usual = travel_of(ObjectOptions{}.tetrahedra, ObjectOptions{}.cells_in_radius, site),
                 fine = travel_of(2 * ObjectOptions{}.tetrahedra, 8, site);
    EXPECT_LT(std::abs(usual / fine - 1), GetParam().most) << "site " << site;
  }
}

// The balloon's skin has a mesh of its own (pressed_balloon_test).
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const BuiltInObject& row : built_in_objects())
    if (row.name != "balloon") all.push_back({std::string(row.name), std::string(row.name), row.name == "bar" ? 0.0023 : row.name == "cube" ? 0.003 : 0.004});
  all.push_back({"bear_in_regions", "bear", 0.004, 1.4});
  return all;
}
INSTANTIATE_TEST_SUITE_P(Objects, Refinement, testing::ValuesIn(cases()), [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace palpate::lab
