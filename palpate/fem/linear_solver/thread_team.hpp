// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <barrier>
#include <exception>
#include <thread>
#include <vector>

namespace palpate::fem {

/// Threads that run the same function on different parts of the data. A team of one never waits.
struct ThreadTeam {
  struct Stopped {};  ///< thrown where another member cannot go on: no error of its own

  int id = 0, count = 1;
  std::barrier<>* barrier = nullptr;
  const std::atomic<bool>* stopped = nullptr;
  /// Returns once every member has come here. @throws Stopped
  void meet() const {
    if (barrier == nullptr) return;
    barrier->arrive_and_wait();
    if (*stopped) throw Stopped{};
  }
};

/// Runs work(team) on `threads` threads, the caller's among them, and returns when all are done. What a member throws (memory
/// may run out in any of them) ends the work of all where they meet next, and is thrown here.
template <class Work>
void run_team(int threads, const Work& work) {
  if (threads <= 1) {
    work(ThreadTeam{});
    return;
  }
  std::barrier<> barrier(threads);
  std::atomic<bool> stopped{false};
  std::vector<std::exception_ptr> faults(static_cast<std::size_t>(threads));
  // Who leaves is waited for no more.
  const auto leave = [&](int id, std::exception_ptr fault) {
    faults[static_cast<std::size_t>(id)] = std::move(fault);
    stopped = true;
    barrier.arrive_and_drop();
  };
  const auto take_part = [&](int id) {
    try {
      work(ThreadTeam{id, threads, &barrier, &stopped});
    } catch (const ThreadTeam::Stopped&) {
      barrier.arrive_and_drop();
    } catch (...) {
      leave(id, std::current_exception());
    }
  };
  {
    std::vector<std::jthread> helpers;
    int id = 1;
    try {
      helpers.reserve(static_cast<std::size_t>(threads - 1));
      for (; id < threads; ++id) helpers.emplace_back(take_part, id);
    } catch (...) {  // no more threads are to be had
      for (; id < threads; ++id) leave(id, std::current_exception());
    }
    take_part(0);
  }
  for (const std::exception_ptr& fault : faults)
    if (fault) std::rethrow_exception(fault);
}

}  // namespace palpate::fem
