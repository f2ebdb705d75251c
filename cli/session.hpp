// SPDX-License-Identifier: Apache-2.0
// What every verb is given: the global options, and the only way to speak. People read stderr, programs read stdout.
// Where nobody reads any more, what is said is dropped: no message is worth a push.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "palpate/core/progress.hpp"

namespace palpate::cli {

enum ExitCode : int {
  exit_done = 0,
  exit_numbers = 1,   ///< the numbers did not work out, or a check failed
  exit_usage = 2,     ///< wrong usage
  exit_input = 3,     ///< bad input: palpate::Error
  exit_internal = 4,  ///< a fault of the program
};

class Session {
 public:
  std::uint64_t seed = 1;
  int threads = 0;  ///< 0 = as many as the machine has; `thread_count()` resolves it
  bool quiet = false;
  bool json = false;

  int thread_count() const;

  /// A line for people on stderr, unless --quiet.
  void say(std::string_view line);
  /// A line that the user asked for by an option: also with --quiet.
  void announce(std::string_view line);
  /// A warning in plain words on stderr, also with --quiet.
  void warn(std::string_view line);
  /// A text that the user asked for (a script), as it is, on stdout.
  void print(std::string_view text);
  /// The one JSON object of this run on stdout, with --json only. NaN becomes null.
  void result(const nlohmann::json& object);

  /// For long work: stage, share done and time left on a terminal, one plain line a stage elsewhere, nothing with --quiet.
  /// Its callback answers false once the user has pressed Ctrl-C. The session must outlive the callback.
  OnProgress progress();
  /// True once the user has pressed Ctrl-C (or SIGTERM came).
  static bool interrupted();

 private:
  bool draw(std::string_view stage, double share);
  void clear_line();

  std::mutex mutex_;
  std::string stage_;
  bool line_open_ = false;
  std::chrono::steady_clock::time_point stage_start_{}, last_draw_{};
};

/// Ctrl-C asks the running work to stop at its next progress report; pressed again it ends the program at once.
void stop_on_interrupt();
/// A program that was started with a stream closed (`2>&-`) would open its first file in its place and write messages into it.
void hold_standard_streams();
/// For verbs that have nothing to save: they end where they are.
void end_at_first_interrupt();

/// A stage of the library ("lattice") in the words of this program ("filling with tetrahedra").
std::string stage_words(std::string_view stage);

/// By the share that is done; nothing while that says little.
std::optional<double> time_left_s(double elapsed_s, double share);

/// "12 s", "3 min 20 s", "1 h 05 min"
std::string duration(double seconds);

}  // namespace palpate::cli
