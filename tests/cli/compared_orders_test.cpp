// label: unit
// SPDX-License-Identifier: Apache-2.0
// What is in the middle of several labs, some of which did not come to the goal.
#include "cli/compared_orders.hpp"

#include <gtest/gtest.h>

namespace palpate::cli::compared_orders_test {
namespace {

TEST(ComparedOrders, RunsThatDidNotComeToTheGoalAreTheLongest) {
  EXPECT_EQ(middle_words({{true, 5}, {true, 3}, {false, 4}}), "5 pushes in the middle of 3 labs (3 to more than 4)");
  EXPECT_EQ(middle_words({{true, 12}, {false, 12}, {false, 12}}), "more than 12 pushes in the middle of 3 labs (12 to more than 12)");
  EXPECT_EQ(middle_words({{true, 2}, {true, 4}}), "4 pushes in the middle of 2 labs (2 to 4)") << "not the better one";
  EXPECT_EQ(middle_words({{true, 1}, {true, 1}}), "1 push in the middle of 2 labs (1 to 1)");
  EXPECT_EQ(middle_words({}), "no lab");
}

TEST(ComparedOrders, TheFileHasEveryLab) {
  const nlohmann::json json = by_seed_json("random order", {{false, 12}, {true, 3}, {true, 5}});
  EXPECT_EQ(json.at("order"), "random order");
  EXPECT_EQ(json.at("pushes"), nlohmann::json({12, 3, 5})) << "in the order of their seeds";
  EXPECT_EQ(json.at("reached"), nlohmann::json({false, true, true}));
  EXPECT_EQ(json.at("middle").at("pushes"), 5);
  EXPECT_TRUE(json.at("middle").at("reached").get<bool>());
  EXPECT_FALSE(by_seed_json("none", {}).contains("middle"));
}

}  // namespace
}  // namespace palpate::cli::compared_orders_test
