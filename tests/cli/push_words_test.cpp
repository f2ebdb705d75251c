// label: unit
// SPDX-License-Identifier: Apache-2.0
// What `record` and `explore` warn of after a push.
#include "cli/push_words.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace palpate::cli::push_words_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(PushWarnings, SayWhatWentWrongAndNothingElse) {
  acquisition::PushReport report;
  report.steps = 3;
  report.highest_force_n = 10;
  report.drift = ForceDrift{Vec3(0.01, 0, 0), 0};
  report.drift_n = 0.4;  // 4 %
  EXPECT_THAT(push_warnings("top", report), IsEmpty());
  report.drift_n = 0.6;
  EXPECT_THAT(push_warnings("top", report), ElementsAre(HasSubstr("top: the zero of the force moved by 0.6 N during the push (10.0 N at most)")));
  report.unsettled = {1};
  report.came_back = false;
  report.changed_share = 0.02;
  EXPECT_THAT(push_warnings("top", report), ElementsAre(HasSubstr("the zero of the force"), HasSubstr("step 1 of top had not settled"),
                                                        HasSubstr("2.00 % of the picture are not as before")));
  report.steps = 0;  // nothing was recorded that drift could spoil
  EXPECT_THAT(push_warnings("top", report), testing::SizeIs(2));
}

TEST(StopWords, NameThePlaceThatTheRobotDoesNotReachOnce) {
  acquisition::PushPlan plan;
  plan.contact_m = Vec3(0.9, 0, 0.1);
  acquisition::PushReport report;
  report.message = "the travel reached its limit";
  report.stop = acquisition::StopReason::travel_limit;
  EXPECT_EQ(stop_words(plan, report, 0.05), report.message);
  report.stop = acquisition::StopReason::robot_limit;
  report.message = "the robot refused to move on: a limit, or out of reach; then the robot refused to move on: a limit, or out of reach";
  const std::string words = stop_words(plan, report, 0.05);
  EXPECT_THAT(words, HasSubstr("at (0.9000 0.0000 0.1000) along (+0.00 +0.00 -1.00), from 50 mm before it"));
  EXPECT_THAT(words, HasSubstr("try another contact or direction"));
  EXPECT_EQ(words.find("refused"), words.rfind("refused"));
}

}  // namespace
}  // namespace palpate::cli::push_words_test
