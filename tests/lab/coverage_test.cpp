// label: statistics
// SPDX-License-Identifier: Apache-2.0
// Seeded labs, each estimated as a user would: how often the intervals hold the truth, and how far off the answers are. A few
// labs by default; PALPATE_LABS=50 lab_coverage_test for figures that mean something, PALPATE_FIRST_SEED to go on elsewhere.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "palpate/identify.hpp"
#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/lab/built_in.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab {
namespace {

struct Lab {
  Recording recording;
  double young_modulus_pa = 0, poisson_ratio = 0;
};

struct SceneOfLabs {
  std::string name;
  std::function<Lab(std::uint64_t seed)> make;
};

int from_environment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text ? std::max(1, std::atoi(text)) : otherwise;
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
  IdentifyOptions options;
  options.fit.threads = from_environment("PALPATE_THREADS", 1);
  Tally young, poisson;
  for (int seed = first; seed < first + labs; ++seed) {
    const Lab lab = scene.make(std::uint64_t(seed));
    const Identification answer = identify(lab.recording, options).answer;
    ASSERT_EQ(answer.termination, Termination::converged) << scene.name << " seed " << seed << ": " << answer.message;
    const Parameter &e = answer.parameters[0], &nu = answer.parameters[1];
    const auto in = [](const Parameter& p, double truth) { return p.lower_95 <= truth && truth <= p.upper_95; };
    young.add(std::log(e.value / lab.young_modulus_pa), e.std / e.value, in(e, lab.young_modulus_pa));
    poisson.add(nu.value - lab.poisson_ratio, nu.std, in(nu, lab.poisson_ratio));
    std::printf("%s seed %d: E %.0f +- %.0f Pa (truth %.0f, pull %+.2f)  nu %.4f +- %.4f (truth %.4f, pull %+.2f)  chi2 %.3f\n",
                scene.name.c_str(), seed, e.value, e.std, lab.young_modulus_pa,
                std::log(e.value / lab.young_modulus_pa) / (e.std / e.value), nu.value, nu.std, lab.poisson_ratio,
                (nu.value - lab.poisson_ratio) / nu.std, answer.fit.chi2_per_dof);
    std::fflush(stdout);
  }
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
Lab pushed(const std::string& name, std::uint64_t seed) {
  ObjectOptions truth;
  truth.seed = seed;
  LabOptions options;
  options.seed = seed;
  LabRobot robot(options, make_object(name, truth));
  acquisition::PushOptions protocol;
  protocol.travel_limit_m = robot.object().travel_limit_m;
  protocol.unloading_steps = 0;
  Lab lab{robot.scene(), robot.object().young_modulus_pa, robot.object().poisson_ratio};
  for (std::size_t site = 0; site < robot.object().sites.size(); ++site) {
    std::vector<Step> steps;
    Push push;
    protocol.force_step_n = robot.object().force_step_at(robot.object().sites[site]);
    acquisition::run_push(robot, robot.plan(site), protocol, [&](const Push& now, const Step& step) {
      push = now;
      steps.push_back(step);
    });
    push.steps = std::move(steps);
    lab.recording.pushes.push_back(std::move(push));
  }
  return lab;
}

std::vector<SceneOfLabs> scenes() {
  std::vector<SceneOfLabs> all{{"demo", cube_on_a_table}};
  for (const BuiltInObject& row : built_in_objects())
    if (row.name != "balloon")  // no solid: it has no E that an interval could hold
      all.push_back({std::string(row.name), [name = std::string(row.name)](std::uint64_t seed) { return pushed(name, seed); }});
  return all;
}

INSTANTIATE_TEST_SUITE_P(Scenes, Coverage, testing::ValuesIn(scenes()),
                         [](const auto& scene) { return scene.param.name; });

}  // namespace
}  // namespace palpate::lab
