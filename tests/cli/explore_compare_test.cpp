// label: unit
// SPDX-License-Identifier: Apache-2.0
// `palpate explore --compare` runs the lab of every seed in three orders, each on an object of its own, and says what each needed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/running_program.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::io::explore_compare_test {
namespace {

using testing::HasSubstr;

class ExploreCompare : public RunningProgram {};

TEST_F(ExploreCompare, EveryOrderPushesInTheLabOfEverySeed) {
  const std::vector<std::string> words{"--seed", "3", "explore", "--object", "cube", "-o", path("out"), "--compare", "--seeds", "2",
                                       // as cheap as a loop gets: few places, one step each, goals that no single push meets
                                       "--contacts", "4", "--tilts", "0", "--levels", "1", "--refine", "none", "--law", "linear",
                                       "--young-modulus-within", "0.001", "--poisson-ratio-within", "0.001", "--pushes", "1"};
  ASSERT_EQ(palpate(words), 1) << said;  // the goal was not met, and said so
  for (const char* line : {"random order: more than 1 push; next best push: more than 1 push", "best place repeated: more than 1 push; next",
                           "the lab of seed 4, next best push:", "next best push: more than 1 push in the middle of 2 labs",
                           "random order: more than 1 push in the middle of 2 labs"})
    EXPECT_THAT(said, HasSubstr(line));
  const nlohmann::json told = nlohmann::json::parse(folder.get("out/exploration.json"));
  EXPECT_FALSE(told.at("reached").get<bool>());
  ASSERT_EQ(told.at("pushes").size(), 1u);
  const nlohmann::json& others = told.at("compared");
  ASSERT_EQ(others.size(), 2u);
  EXPECT_EQ(others[0].at("order"), "random order");
  EXPECT_EQ(others[1].at("order"), "best place repeated");
  for (const nlohmann::json& one : others) {
    ASSERT_EQ(one.at("pushes").size(), 1u);
    const double young_pa = one.at("pushes")[0].at("young_modulus_pa"), first_pa = told.at("pushes")[0].at("young_modulus_pa");
    EXPECT_NEAR(young_pa / first_pa, 1, 0.3) << "the same object";
  }
  // The best place alone is where the next best push began.
  EXPECT_EQ(others[1].at("pushes")[0].at("contact_m"), told.at("pushes")[0].at("contact_m"));
  const nlohmann::json& seeds = told.at("by_seed");
  ASSERT_EQ(seeds.size(), 3u);
  for (const nlohmann::json& order : seeds) {
    EXPECT_EQ(order.at("pushes"), nlohmann::json({1, 1}));
    EXPECT_EQ(order.at("reached"), nlohmann::json({false, false}));
  }
  EXPECT_EQ(read_recording(folder.path() / "out/recording").pushes.size(), 1u) << "what is compared is not recorded";
}

}  // namespace
}  // namespace palpate::io::explore_compare_test
