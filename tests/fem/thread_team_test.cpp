// label: unit
// SPDX-License-Identifier: Apache-2.0
// A team of threads that meet, and one whose members cannot all go on.
#include "palpate/fem/linear_solver/thread_team.hpp"

#include <gtest/gtest.h>

#include <new>
#include <stdexcept>

namespace palpate::fem::thread_team_test {
namespace {

TEST(ThreadTeam, MembersMeet) {
  for (const int threads : {1, 2, 3, 5}) {
    std::vector<int> arrived(static_cast<std::size_t>(threads), 0), seen(arrived);
    run_team(threads, [&](const ThreadTeam& team) {
      for (int round = 1; round <= 50; ++round) {
        arrived[static_cast<std::size_t>(team.id)] = round;
        team.meet();
        for (const int other : arrived) seen[static_cast<std::size_t>(team.id)] += other == round;
        team.meet();
      }
    });
    EXPECT_EQ(seen, std::vector<int>(seen.size(), 50 * threads));
  }
}

TEST(ThreadTeam, WhatAMemberThrowsEndsTheWorkOfAllAndIsThrown) {
  for (const int threads : {1, 2, 3, 5}) {
    for (int thrower = 0; thrower < threads; ++thrower) {
      for (const int round : {0, 1, 7}) {
        std::atomic<int> finished{0};
        EXPECT_THROW(run_team(threads,
                              [&](const ThreadTeam& team) {
                                for (int k = 0; k < 10; ++k) {
                                  if (team.id == thrower && k == round) throw std::bad_alloc();
                                  team.meet();
                                }
                                ++finished;
                              }),
                     std::bad_alloc)
            << threads << ", " << thrower << ", " << round;
        EXPECT_EQ(finished, 0);
      }
    }
  }
}

TEST(ThreadTeam, OneOfSeveralErrorsIsThrown) {
  EXPECT_THROW(run_team(4, [](const ThreadTeam& team) { throw std::runtime_error(std::to_string(team.id)); }), std::runtime_error);
}

}  // namespace
}  // namespace palpate::fem::thread_team_test
