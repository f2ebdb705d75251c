// label: statistics
// SPDX-License-Identifier: Apache-2.0
// An object that one camera saw from one side: E with the shape completed, beside E with the whole shape given. Every lab has a
// truth, sensors and a direction of sight of its own, about the one of the camera that watches the pushes. PALPATE_LABS says how
// many (by default one each, and eight each of shapes alone), PALPATE_FIRST_SEED where to begin.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "geometry/overlap.hpp"
#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/identify.hpp"
#include "palpate/lab/random.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab::partly_seen_test {
namespace {

int from_environment(const char* name, int otherwise) {
  const char* said = std::getenv(name);
  return said ? std::atoi(said) : otherwise;
}

Push push_at(LabRobot& robot, std::size_t site) {
  acquisition::PushOptions protocol;
  protocol.travel_limit_m = robot.object().travel_limit_m;
  protocol.force_step_n = 1.4 * robot.object().force_step_at(robot.object().sites[site]);
  protocol.unloading_steps = 0;
  return acquisition::whole_push(robot, robot.plan(site), protocol);
}

/// From one side, drawn about that of the camera that watches the pushes.
struct Sight {
  double around_rad = 0, above_rad = 0;
};

Sight sight_of(int seed) {
  Random random(std::uint64_t(seed), 77);
  const double around = -2.0 + random.uniform(-M_PI / 4, M_PI / 4);
  return {around, random.uniform(M_PI / 9, M_PI / 3)};
}

class PartlySeen : public testing::TestWithParam<const char*> {};

TEST_P(PartlySeen, IntervalHoldsTheTruthAllTheSame) {
  const int labs = from_environment("PALPATE_LABS", 1), first = from_environment("PALPATE_FIRST_SEED", 1);
  std::vector<double> half_widths;
  int held = 0, held_full = 0;
  for (int seed = first; seed < first + labs; ++seed) {
    ObjectOptions truth;
    truth.seed = std::uint64_t(seed);
    truth.material = "linear";
    LabOptions options;
    options.seed = std::uint64_t(seed);
    LabRobot robot(options, make_object(GetParam(), truth));
    Recording full = robot.scene();
    full.pushes.push_back(push_at(robot, std::size_t(seed) % robot.object().sites.size()));
    Recording part = full;
    part.rest.surface.reset();
    const auto [around, above] = sight_of(seed);
    part.rest.views = robot.look_from({{around, above}});

    IdentifyOptions identification;
    identification.fit.cross_checks = identification.fit.stresses = false;
    const Identification whole = identify(full, identification).answer, partly = identify(part, identification).answer;
    ASSERT_FALSE(partly.parameters.empty()) << partly.message;
    const double true_pa = robot.object().young_modulus_pa;
    const auto& e = partly.parameters[0];
    const auto in = [&](const Parameter& p) { return p.lower_95 <= true_pa && true_pa <= p.upper_95; };
    held += in(e), held_full += in(whole.parameters[0]);
    half_widths.push_back(0.5 * (e.upper_95 - e.lower_95) / e.value);
    std::printf("%s seed %d, %s, seen from %+.0f, %.0f degrees: E / true %.3f [%.3f, %.3f], whole shape %.3f [%.3f, %.3f]; nu %.2f, %.2f (%.2f)",
                GetParam(), seed, full.pushes[0].site.c_str(), around * 180 / M_PI, above * 180 / M_PI, e.value / true_pa,
                e.lower_95 / true_pa, e.upper_95 / true_pa, whole.parameters[0].value / true_pa, whole.parameters[0].lower_95 / true_pa,
                whole.parameters[0].upper_95 / true_pa, partly.parameters[1].value, whole.parameters[1].value, robot.object().poisson_ratio);
    for (const auto& entry : partly.budget)
      if (entry.input == "unseen side") std::printf("; unseen side %.1f %%", entry.young_modulus_percent);
    for (const auto& verdict : partly.verdicts) std::printf(" %s", verdict.code.c_str());
    for (const auto& nuisance : partly.nuisances)
      if (std::abs(nuisance.pull) > 3) std::printf("; %s %+.2g %s (%+.1f)", nuisance.name.c_str(), nuisance.value, nuisance.unit.c_str(), nuisance.pull);
    std::printf("\n");
    std::fflush(stdout);
    EXPECT_TRUE(std::any_of(partly.verdicts.begin(), partly.verdicts.end(), [](const auto& v) { return v.code == "partly_seen"; }));
    EXPECT_TRUE(std::none_of(whole.verdicts.begin(), whole.verdicts.end(), [](const auto& v) { return v.code == "partly_seen"; }));
  }
  std::nth_element(half_widths.begin(), half_widths.begin() + labs / 2, half_widths.end());
  std::printf("%s: %d of %d hold the truth (whole shape %d), median half-width %.1f %%\n", GetParam(), held, labs, held_full,
              100 * half_widths[std::size_t(labs / 2)]);
  // 45 of 50; of few, one may miss
  EXPECT_GE(held, labs - std::max(1, labs / 10));
  if (labs >= 5) {
    EXPECT_LE(half_widths[std::size_t(labs / 2)], 0.3);
  }
}

// The same views alone, without a push: what the completed shape shares with the true one.
TEST_P(PartlySeen, CompletedShapeIsNearTheTrueOne) {
  const int labs = std::max(3, from_environment("PALPATE_LABS", 8)), first = from_environment("PALPATE_FIRST_SEED", 1);
  double shared = 0, squares = 0;
  for (int seed = first; seed < first + labs; ++seed) {
    ObjectOptions truth;
    truth.seed = std::uint64_t(seed);
    LabOptions options;
    options.seed = std::uint64_t(seed);
    LabRobot robot(options, make_object(GetParam(), truth));
    Recording recording = robot.scene();
    const geometry::Solid whole(*recording.rest.surface);
    const double volume_m3 = *geometry::check_surface(*recording.rest.surface).volume_m3;
    recording.rest.surface.reset();
    const auto [around, above] = sight_of(seed);
    recording.rest.views = robot.look_from({{around, above}});
    build_simulated_object(recording, {});
    const double both = geometry::overlap(whole, geometry::Solid(*recording.rest.surface));
    const double ratio = geometry::check_volume(*recording.rest.volume).volume_m3 / volume_m3;
    std::printf("%s seed %d, seen from %+.0f, %.0f degrees: shares %.2f of the volume of both, volume / true %.2f\n", GetParam(), seed,
                around * 180 / M_PI, above * 180 / M_PI, both, ratio);
    shared += both / labs, squares += std::pow(std::log(ratio), 2) / labs;
  }
  std::printf("%s: shares %.2f, volume off by %.1f %% rms\n", GetParam(), shared, 100 * std::sqrt(squares));
  const bool box = std::string(GetParam()) == "cube";
  EXPECT_GT(shared, box ? 0.9 : 0.7);
  EXPECT_LT(std::sqrt(squares), box ? 0.1 : 0.15);
}

INSTANTIATE_TEST_SUITE_P(Objects, PartlySeen, testing::Values("cube", "bear"), [](const auto& scene) { return std::string(scene.param); });

}  // namespace
}  // namespace palpate::lab::partly_seen_test
