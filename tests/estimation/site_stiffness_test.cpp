// label: unit
// SPDX-License-Identifier: Apache-2.0
// A block pushed at two places: that its halves differ is said, with about how much, and nothing is said where they do not.
#include "palpate/estimation/site_stiffness.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pushed_block.hpp"

namespace palpate::estimation::site_stiffness_test {
namespace {

const Vec3 left_m(0.015, 0.02, block_size_m.z()), right_m(0.045, 0.02, block_size_m.z());

/// Glued to the table and pressed from above on either half.
Recording pressed_twice() {
  Recording recording = pushed_block_recording();
  recording.supports[0].kind = SupportKind::plane;
  recording.supports[0].plane = {Vec3::Zero(), Vec3::UnitZ()};
  const Push push = recording.pushes[0];
  recording.pushes.clear();
  for (const Vec3& at_m : {left_m, right_m}) {
    recording.pushes.push_back(push);
    recording.pushes.back().name = at_m == left_m ? "left" : "right";
    for (std::size_t s = 0; s < push.steps.size(); ++s) {
      Load& load = recording.pushes.back().steps[s].loads[0];
      load.contact_m = at_m;
      load.force_n = Vec3(0, 0, -1.5 * (1 + double(s)));
    }
  }
  return recording;
}

Identification fitted(double right_over_left, unsigned seed, const std::string& material) {
  PushedBlock truth;
  truth.free_half = right_over_left;
  truth.points = 1500;
  truth.sigma_m = 2e-4;
  truth.seed = seed;
  truth.material = material;
  FitOptions options;
  options.stresses = false;
  SimulatedObject object = simulated(fem::to_quadratic(kuhn_block(6, 4, 3, block_size_m)), material);
  const Recording recording = pressed_twice();
  return fit(recording, object, clouds_of(truth, recording), options);
}

class OfTwoHalves : public testing::TestWithParam<const char*> {};

TEST_P(OfTwoHalves, NothingIsSaidWhereTheyAreAlike) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const Identification answer = fitted(1, seed, GetParam());
    for (const char* code : {"not_homogeneous", "contact_elsewhere", "tool_radius_doubtful", "boundary_suspected"})
      EXPECT_FALSE(says(answer, code)) << code << " of seed " << seed;
  }
}

TEST_P(OfTwoHalves, ADifferenceIsSaidWithItsSize) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const Identification answer = fitted(1.25, seed, GetParam());
    const auto said = std::find_if(answer.verdicts.begin(), answer.verdicts.end(), [](const Verdict& v) { return v.code == "not_homogeneous"; });
    ASSERT_NE(said, answer.verdicts.end()) << "seed " << seed;
    double left_kpa = 0, right_kpa = 0;
    const std::size_t at = said->message.find("about ");
    ASSERT_NE(at, std::string::npos) << said->message;
    ASSERT_EQ(std::sscanf(said->message.c_str() + at, "about %lf kPa around left, %lf kPa around right", &left_kpa, &right_kpa), 2)
        << said->message;
    EXPECT_NEAR(left_kpa, 20, 1.5);  // one step from the fit of one E
    EXPECT_NEAR(right_kpa, 25, 1.9);
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, OfTwoHalves, testing::Values("linear", "neo_hookean"), [](const auto& law) { return std::string(law.param); });

TEST(SitesPushed, AreApart) {
  const Recording two = pressed_twice();
  const std::vector<Region> sites = sites_pushed(two);
  ASSERT_EQ(sites.size(), 2u);
  EXPECT_EQ(sites[0].name, "left");
  EXPECT_EQ(sites[1].points_m.row(0).transpose(), right_m);

  Recording near = two;  // within the tool's radius
  for (Step& step : near.pushes[1].steps) step.loads[0].contact_m = left_m + Vec3(0.9 * near.tools[0].radius_m, 0, 0);
  EXPECT_TRUE(sites_pushed(near).empty());

  Recording given = two;
  given.regions.resize(2);
  EXPECT_TRUE(sites_pushed(given).empty());

  Recording moved = two;  // by motions whose force is not known
  for (Push& push : moved.pushes)
    for (Step& step : push.steps) step.loads[0].force_n.reset();
  EXPECT_TRUE(sites_pushed(moved).empty());

  Recording many = two;
  for (int k = 0; k < 20; ++k) {
    many.pushes.push_back(two.pushes[0]);
    many.pushes.back().site = "site " + std::to_string(k);
    for (Step& step : many.pushes.back().steps) step.loads[0].contact_m = Vec3(0.003 * k, 0.035, block_size_m.z());
  }
  const std::vector<Region> furthest = sites_pushed(many);
  EXPECT_GT(furthest.size(), 2u);
  EXPECT_LE(furthest.size(), 6u);
  for (std::size_t a = 0; a < furthest.size(); ++a)
    for (std::size_t b = 0; b < a; ++b)
      EXPECT_GT((furthest[a].points_m - furthest[b].points_m).norm(), many.tools[0].radius_m);
}

TEST(SiteStiffness, ChanceOfADifferenceHoldsWhatContactsLeaveOpen) {
  // One ratio known to 1 %: the contacts of both places add 2 % each.
  const double std = std::sqrt(0.01 * 0.01 + 2 * 0.02 * 0.02);
  const SiteStiffness found = site_stiffness({"a", "b"}, std::log(2e4), VectorX::Constant(1, 3 * std), MatrixX::Constant(1, 1, 1e-4));
  EXPECT_NEAR(found.p_value, std::erfc(3 / std::sqrt(2.0)), 1e-12);
  EXPECT_NEAR(found.log_young(1) - found.log_young(0), 3 * std, 1e-12);
}

}  // namespace
}  // namespace palpate::estimation::site_stiffness_test
