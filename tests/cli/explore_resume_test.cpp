// label: unit
// SPDX-License-Identifier: Apache-2.0
// `palpate explore` killed in the middle of a push goes on with --resume, and with the same thing only; its camera may be carried
// around first.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/running_program.hpp"
#include "io/recording_folder.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::io::explore_resume_test {
namespace {

using namespace palpate::io::test;
using testing::HasSubstr;

const std::string scene = PALPATE_SOURCE_DIR "/examples/driver/soft_scene";
constexpr int input = 3;
constexpr int in_doubt = 1;

class ExploreResume : public RunningProgram {
 protected:
  std::vector<std::string> explore(const std::string& driver, std::vector<std::string> more = {}) const {
    std::vector<std::string> words{"--seed", "1", "explore", "--driver", driver, "--driver-settings", "soft 20000 0.3", "--scene", scene,
                                   "-o", path("out"), "--contacts", "6", "--tilts", "0", "--levels", "2", "--refine", "none"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  /// Some pushes.
  std::vector<std::string> to_the_goal(const std::string& driver, std::vector<std::string> more = {}) const {
    more.insert(more.end(), {"--young-modulus-within", "0.05", "--poisson-ratio-within", "0.09", "--pushes", "4"});
    return explore(driver, more);
  }
  std::vector<std::string> one_push(std::vector<std::string> more) const {
    more.insert(more.end(), {"--young-modulus-within", "0.3", "--poisson-ratio-within", "0.3", "--pushes", "1"});
    return explore(PALPATE_SPRING_ROBOT, more);
  }
  nlohmann::json told() const { return nlohmann::json::parse(folder.get("out/exploration.json")); }
  /// Its intervals are narrow. The mesh is too coarse for the edge of the patch, whose radius the answer may put in doubt.
  void expect_narrow(const std::vector<std::string>& words) {
    const int code = palpate(words);
    const std::string narrow = "both intervals are as narrow as was asked for", doubted = narrow + ", but not to be believed: tool_radius_doubtful";
    ASSERT_LE(code, in_doubt) << said;
    EXPECT_EQ(told().at("message"), code == 0 ? narrow : doubted);
    EXPECT_EQ(told().at("reached").get<bool>(), code == 0) << said;
  }
  Recording recorded() const { return read_recording_unchecked(folder.path() / "out/recording"); }
  /// @param steps  of this push that are told before
  void kill_at(const pid_t child, const std::string& push, int steps) {
    for (int step = 0; step < steps; ++step) ASSERT_TRUE(says(push + ", ")) << said;
    kill(child, SIGKILL);
    EXPECT_EQ(wait_for(child), 1000 + SIGKILL);
  }
};

TEST_F(ExploreResume, KilledUnderLoadItGoesOnAndComesToItsGoal) {
  kill_at(start(to_the_goal(PALPATE_PATIENT_ROBOT)), "push 2", 2);  // the look before it, and the first load
  const Recording cut = recorded();
  ASSERT_EQ(cut.pushes.size(), 2u);
  ASSERT_FALSE(cut.pushes[1].steps.back().loads.empty());
  const nlohmann::json before = told();
  EXPECT_FALSE(before.at("reached").get<bool>());
  ASSERT_EQ(before.at("pushes").size(), 1u) << "push by push";

  EXPECT_EQ(palpate(to_the_goal(PALPATE_SPRING_ROBOT)), input);
  EXPECT_THAT(said, HasSubstr("say --resume to go on"));
  std::vector<std::string> other = to_the_goal(PALPATE_SPRING_ROBOT, {"--resume", "--law", "foam"});
  EXPECT_EQ(palpate(other), input);
  EXPECT_THAT(said, HasSubstr("cannot go on: its model's material is linear, and this command has foam"));
  EXPECT_EQ(recorded().pushes.size(), 2u);

  ASSERT_NO_FATAL_FAILURE(expect_narrow(to_the_goal(PALPATE_SPRING_ROBOT, {"--resume"})));
  EXPECT_THAT(said, HasSubstr("push 2 was cut off: its "));
  EXPECT_THAT(said, HasSubstr("push 2 and all before it, by an earlier run: E "));
  const nlohmann::json after = told();
  const std::size_t pushes = after.at("pushes").size();
  EXPECT_GE(pushes, 2u);  // as many as if nothing had been ...
  EXPECT_LE(pushes, 3u);  // ... or one more, for the one that was cut off says less
  nlohmann::json first = before.at("pushes")[0];
  first["earlier_run"] = true;
  EXPECT_EQ(after.at("pushes")[0], first) << "what it was promised is not forgotten";
  EXPECT_TRUE(after.at("pushes")[1].at("earlier_run").get<bool>());
  EXPECT_TRUE(after.at("pushes")[1].at("stop").is_null());
  const Recording whole = read_recording(folder.path() / "out/recording");
  EXPECT_TRUE(check_recording(whole).empty());
  ASSERT_EQ(whole.pushes.size(), pushes);
  double time_s = -1;
  for (const Push& push : whole.pushes)
    for (const Step& step : push.steps) {
      EXPECT_GT(step.time_s, time_s);
      time_s = step.time_s;
    }
}

TEST_F(ExploreResume, KilledBeforeItPressedThePushIsChosenAnew) {
  kill_at(start(explore(PALPATE_PATIENT_ROBOT)), "push 1", 1);
  ASSERT_EQ(recorded().pushes.size(), 1u);
  ASSERT_NO_FATAL_FAILURE(expect_narrow(one_push({"--resume"})));
  EXPECT_THAT(said, HasSubstr("push 1 was cut off before it pressed"));
  EXPECT_EQ(told().at("pushes").size(), 1u);
  EXPECT_EQ(told().at("pushes")[0].at("push"), "push 1");
  const Recording whole = read_recording(folder.path() / "out/recording");
  ASSERT_EQ(whole.pushes.size(), 1u);
  EXPECT_EQ(whole.pushes[0].steps.size(), 6u);
  folder.put("other/words.txt", "not of a run of explore\n");
  std::vector<std::string> elsewhere = explore(PALPATE_SPRING_ROBOT, {"--resume"});
  for (std::string& word : elsewhere)
    if (word == path("out")) word = path("other");
  EXPECT_EQ(palpate(elsewhere), input);
  EXPECT_THAT(said, HasSubstr("cannot go on: it holds no `recording`"));
  EXPECT_EQ(folder.get("other/words.txt"), "not of a run of explore\n");
}

TEST_F(ExploreResume, TheShapeMayBeLookedAt) {
  std::vector<std::string> words = explore(PALPATE_PATIENT_ROBOT, {"--views", "5"});
  kill_at(start(words), "push 1", 2);
  const Recording made = recorded();
  EXPECT_EQ(made.rest.views.size(), 5u);
  EXPECT_FALSE(made.rest.surface);
  EXPECT_NEAR(made.pushes.at(0).steps.at(1).loads.at(0).contact_m.z(), 0.2, 0.003) << "on the block as it was seen";
  EXPECT_EQ(palpate(explore(PALPATE_SPRING_ROBOT, {"--resume"})), input);
  EXPECT_THAT(said, HasSubstr("its rest shape is views, and this command has a surface mesh"));
}

}  // namespace
}  // namespace palpate::io::explore_resume_test
