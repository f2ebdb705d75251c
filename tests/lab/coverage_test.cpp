// label: statistics
// SPDX-License-Identifier: Apache-2.0
// Seeded labs, each estimated as a user would: how often the intervals hold the truth, and how far off the answers are. A few
// labs by default; PALPATE_LABS=50 lab_coverage_test for figures that mean something, PALPATE_FIRST_SEED to go on elsewhere,
// PALPATE_THROUGH=folder or mcap to estimate what was written there and read again (read_back_test.cpp: the same to rounding),
// PALPATE_CAMERA=hand for a camera that the hand carries.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "io/read_back.hpp"
#include "palpate/identify.hpp"
#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/lab/built_in.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab::coverage_test {
namespace {

struct Lab {
  Recording recording;
  double young_modulus_pa = 0, poisson_ratio = 0;
  std::map<std::string, double> region_pa = {};
};

struct SceneOfLabs {
  std::string name;
  std::function<Lab(std::uint64_t seed)> make;
};

void PrintTo(const SceneOfLabs& scene, std::ostream* out) { *out << scene.name; }

int from_environment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text ? std::max(1, std::atoi(text)) : otherwise;
}

// Estimated as it came out of memory, or out of files.
Identification estimated(const Recording& recording) {
  const char* way = std::getenv("PALPATE_THROUGH");
  IdentifyOptions options;
  options.fit.threads = from_environment("PALPATE_THREADS", 1);
  return identify(io::test::through(way ? way : "memory", recording), options).answer;
}

struct Tally {
  int labs = 0, in_68 = 0, in_95 = 0;
  double sum = 0, squares = 0, stated = 0;
  void add(double error, double std, bool in) {
    ++labs;
    in_68 += std::abs(error) < std;
    in_95 += in;
    sum += error;
    squares += error * error;
    stated += std;
  }
  // Share of hits within three binomial standard deviations (and half a hit) of what is nominal.
  static bool fair(int hits, int labs, double nominal) {
    return std::abs(hits - nominal * labs) <= 3 * std::sqrt(labs * nominal * (1 - nominal)) + 0.5;
  }
  void print(const char* scene, const char* what, double unit) const {
    std::printf("| %-14s | %-5s | %3d | %3.0f %% | %3.0f %% | %+8.4f +- %.4f | %.4f | %.4f |\n", scene, what, labs, 100.0 * in_68 / labs,
                100.0 * in_95 / labs, unit * sum / labs, unit * std::sqrt(squares / labs / labs), unit * std::sqrt(squares / labs),
                unit * stated / labs);
  }
};

class Coverage : public testing::TestWithParam<SceneOfLabs> {};

TEST_P(Coverage, IntervalsHoldTheTruthAsOftenAsTheySay) {
  const SceneOfLabs& scene = GetParam();
  const int labs = from_environment("PALPATE_LABS", 3), first = from_environment("PALPATE_FIRST_SEED", 1);
  Tally young, poisson;
  std::map<std::string, int> verdicts;
  for (int seed = first; seed < first + labs; ++seed) {
    const Lab lab = scene.make(std::uint64_t(seed));
    const Identification answer = estimated(lab.recording);
    ASSERT_EQ(answer.termination, Termination::converged) << scene.name << " seed " << seed << ": " << answer.message;
    const auto in = [](const Parameter& p, double truth) { return p.lower_95 <= truth && truth <= p.upper_95; };
    std::printf("%s seed %d:", scene.name.c_str(), seed);
    for (const Parameter& p : answer.parameters) {
      if (p.name == "young_modulus") {
        const double truth = p.region.empty() ? lab.young_modulus_pa : lab.region_pa.at(p.region);
        const double error = std::log(p.value / truth), std = p.std / p.value;
        young.add(error, std, in(p, truth));
        std::printf("  E %s%.0f +- %.0f Pa (truth %.0f, pull %+.2f)", p.region.c_str(), p.value, p.std, truth, error / std);
      } else if (p.name == "poisson_ratio") {
        poisson.add(p.value - lab.poisson_ratio, p.std, in(p, lab.poisson_ratio));
        std::printf("  nu %.4f +- %.4f (truth %.4f, pull %+.2f)", p.value, p.std, lab.poisson_ratio, (p.value - lab.poisson_ratio) / p.std);
      }
    }
    std::printf("  chi2 %.3f  mesh %s ", answer.fit.chi2_per_dof, answer.provenance.at("mesh").c_str());
    for (const Verdict& verdict : answer.verdicts) {
      std::printf(" %s", verdict.code.c_str());
      ++verdicts[verdict.code];
    }
    std::printf("\n");
    std::fflush(stdout);
  }
  for (const auto& [code, count] : verdicts) std::printf("%s: %s in %d of %d\n", scene.name.c_str(), code.c_str(), count, labs);
  std::printf("| scene          |       | labs | 68 %% | 95 %% | bias (log E in %%, nu) | rms | stated |\n");
  young.print(scene.name.c_str(), "E", 100);
  poisson.print(scene.name.c_str(), "nu", 1);
  for (const Tally* tally : {&young, &poisson}) {
    EXPECT_TRUE(Tally::fair(tally->in_95, tally->labs, 0.95)) << scene.name << ": " << tally->in_95 << " of " << tally->labs;
    EXPECT_TRUE(Tally::fair(tally->in_68, tally->labs, 0.68)) << scene.name << ": " << tally->in_68 << " of " << tally->labs;
  }
}

Lab cube_on_a_table(std::uint64_t seed) {
  DemoOptions options;
  options.seed = seed;
  options.threads = 1;
  Demo demo = make_demo(options);
  return {std::move(demo.recording), demo.truth.young_modulus_pa, demo.truth.poisson_ratio};
}

// Through the push protocol, one push a site.
Lab pushed(const std::string& name, std::uint64_t seed, double region_ratio = 1) {
  ObjectOptions truth;
  truth.seed = seed;
  truth.region_ratio = region_ratio;
  LabOptions options;
  options.seed = seed;
  const char* camera = std::getenv("PALPATE_CAMERA");
  options.camera_on_hand = camera && std::string(camera) == "hand";
  LabRobot robot(options, make_object(name, truth));
  acquisition::PushOptions protocol;
  protocol.travel_limit_m = robot.object().travel_limit_m;
  protocol.unloading_steps = 0;
  Lab lab{robot.scene(), robot.object().young_modulus_pa, robot.object().poisson_ratio};
  for (const TrueRegion& one : robot.object().regions) lab.region_pa[one.region.name] = one.young_modulus_pa;
  for (std::size_t site = 0; site < robot.object().sites.size(); ++site) {
    protocol.force_step_n = robot.object().force_step_at(robot.object().sites[site]);
    lab.recording.pushes.push_back(acquisition::whole_push(robot, robot.plan(site), protocol));
  }
  return lab;
}

std::vector<SceneOfLabs> scenes() {
  std::vector<SceneOfLabs> all{{"demo", cube_on_a_table}};
  for (const BuiltInObject& row : built_in_objects())
    if (row.name != "balloon")  // no solid: it has no E that an interval could hold
      all.push_back({std::string(row.name), [name = std::string(row.name)](std::uint64_t seed) { return pushed(name, seed); }});
  all.push_back({"bear_in_regions", [](std::uint64_t seed) { return pushed("bear", seed, 1.4); }});
  return all;
}

// One who does not know of the regions is told so: head, belly and back differ by a factor of 1.2 each.
TEST(Homogeneity, OfABearThatIsNotIsDoubted) {
  const int labs = from_environment("PALPATE_LABS", 3), first = from_environment("PALPATE_FIRST_SEED", 1);
  int said = 0;
  for (int seed = first; seed < first + labs; ++seed) {
    Lab lab = pushed("bear", std::uint64_t(seed), 1.2);
    lab.recording.regions.clear();
    const Identification answer = estimated(lab.recording);
    std::printf("bear seed %d:", seed);
    for (const Verdict& verdict : answer.verdicts) std::printf(" %s", verdict.code.c_str());
    std::printf("\n");
    std::fflush(stdout);
    said += std::any_of(answer.verdicts.begin(), answer.verdicts.end(), [](const Verdict& one) { return one.code == "not_homogeneous"; });
  }
  EXPECT_GE(said, 0.9 * labs - 0.5);
}

INSTANTIATE_TEST_SUITE_P(Scenes, Coverage, testing::ValuesIn(scenes()),
                         [](const auto& scene) { return scene.param.name; });

}  // namespace
}  // namespace palpate::lab::coverage_test
