// label: unit
// SPDX-License-Identifier: Apache-2.0
// What `record` and `explore` warn of after a push.
#include "cli/push_words.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace palpate::cli {
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

}  // namespace
}  // namespace palpate::cli
