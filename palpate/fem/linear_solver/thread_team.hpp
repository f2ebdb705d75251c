// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <barrier>
#include <thread>
#include <vector>

namespace palpate::fem {

/// Threads that run the same function on different parts of the data. A team of one never waits.
struct ThreadTeam {
  int id = 0, count = 1;
  std::barrier<>* barrier = nullptr;
  /// Returns once every member has come here.
  void meet() const {
    if (barrier != nullptr) barrier->arrive_and_wait();
  }
};

/// Runs work(team) on `threads` threads, the caller's among them, and returns when all are done.
template <class Work>
void run_team(int threads, const Work& work) {
  if (threads <= 1) {
    work(ThreadTeam{});
    return;
  }
  std::barrier<> barrier(threads);
  std::vector<std::jthread> helpers;
  for (int id = 1; id < threads; ++id) {
    helpers.emplace_back([&work, &barrier, id, threads] { work(ThreadTeam{id, threads, &barrier}); });
  }
  work(ThreadTeam{0, threads, &barrier});
}

}  // namespace palpate::fem
