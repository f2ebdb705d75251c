// label: unit
// SPDX-License-Identifier: Apache-2.0
// Every number of the push protocol can be said on the command line, and arrives where it belongs.
#include "cli/push_options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "palpate/core/error.hpp"

namespace palpate::cli::push_options_test {
namespace {

acquisition::PushOptions parsed(const std::vector<std::string>& words) {
  acquisition::PushOptions push;
  CLI::App app;
  add_force_step_option(app, push);
  add_push_limits(app, push);
  add_push_thresholds(app, push);
  app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  return push;
}

TEST(PushOptionWords, NothingSaidIsTheProtocolsOwnAndTheObjectsLimits) {
  const acquisition::PushOptions push = parsed({}), own;
  EXPECT_EQ(push.force_limit_n, 50);
  EXPECT_EQ(push.travel_limit_m, 0);
  EXPECT_EQ(push.force_step_n, 0);
  EXPECT_EQ(push.settling.window_s, own.settling.window_s);
  EXPECT_EQ(push.increment_m, own.increment_m);
  EXPECT_NO_THROW(check_push_options(push));
}

TEST(PushOptionWords, EveryNumberArrives) {
  const acquisition::PushOptions p = parsed(
      {"--force-limit", "1.5", "--travel-limit", "0.02", "--force-step", "0.3", "--unloading-steps", "4", "--contact-std", "0.005",
       "--start-distance", "0.06", "--search-distance", "0.07", "--increment", "0.0008", "--clearance", "0.03", "--tool-length", "0.5", "--look-every", "0.02",
       "--blind-retreat", "0.31", "--approach-speed", "0.09", "--push-speed", "0.01",
       "--sample-period", "0.011", "--free-air-samples", "12", "--contact-threshold", "0.13", "--contact-noise-factor", "14",
       "--contact-samples", "15", "--obstacle-threshold", "0.155", "--settling-rate", "0.16", "--settling-relative-rate", "0.17", "--settling-window", "0.18",
       "--settling-timeout", "19", "--slip-sideways", "0.2", "--slip-friction", "0.21", "--slip-force-drop", "0.22", "--slip-deeper",
       "0.23", "--slip-least-force", "0.24", "--changed-share", "0.25"});
  EXPECT_EQ(p.force_limit_n, 1.5);
  EXPECT_EQ(p.travel_limit_m, 0.02);
  EXPECT_EQ(p.force_step_n, 0.3);
  EXPECT_EQ(p.unloading_steps, 4);
  EXPECT_EQ(p.contact_std_m, 0.005);
  EXPECT_EQ(p.start_distance_m, 0.06);
  EXPECT_EQ(p.search_distance_m, 0.07);
  EXPECT_EQ(p.increment_m, 0.0008);
  EXPECT_EQ(p.clearance_m, 0.03);
  EXPECT_EQ(p.tool_length_m, 0.5);
  EXPECT_EQ(p.look_every_m, 0.02);
  EXPECT_EQ(p.blind_retreat_m, 0.31);
  EXPECT_EQ(p.approach_speed_m_s, 0.09);
  EXPECT_EQ(p.push_speed_m_s, 0.01);
  EXPECT_EQ(p.sample_period_s, 0.011);
  EXPECT_EQ(p.free_air_samples, 12);
  EXPECT_EQ(p.contact.threshold_n, 0.13);
  EXPECT_EQ(p.contact.noise_factor, 14);
  EXPECT_EQ(p.contact.confirm_samples, 15);
  EXPECT_EQ(p.obstacle_threshold_n, 0.155);
  EXPECT_EQ(p.settling.rate_n_s, 0.16);
  EXPECT_EQ(p.settling.relative_rate_s, 0.17);
  EXPECT_EQ(p.settling.window_s, 0.18);
  EXPECT_EQ(p.settling_timeout_s, 19);
  EXPECT_EQ(p.slip.tangential_m, 0.2);
  EXPECT_EQ(p.slip.friction_limit, 0.21);
  EXPECT_EQ(p.slip.force_drop, 0.22);
  EXPECT_EQ(p.slip.deeper_m, 0.23);
  EXPECT_EQ(p.slip.least_force_n, 0.24);
  EXPECT_EQ(p.changed_share, 0.25);
}

TEST(PushOptionWords, WhatCannotBeIsRefused) {
  for (const auto& wrong : std::vector<std::vector<std::string>>{{"--force-limit", "-1"}, {"--increment", "0"}, {"--free-air-samples", "1"},
                                                                 {"--slip-force-drop", "1.5"}, {"--contact-std", "nan"}})
    EXPECT_THROW(parsed(wrong), CLI::ParseError) << wrong[0];
  EXPECT_THROW(check_push_options(parsed({"--increment", "0.02"})), Error);
  EXPECT_THROW(check_push_options(parsed({"--settling-timeout", "1"})), Error) << "shorter than its window";
}

}  // namespace
}  // namespace palpate::cli::push_options_test
