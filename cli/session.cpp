// SPDX-License-Identifier: Apache-2.0
#include "cli/session.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>

#include "palpate/core/thread_count.hpp"

namespace palpate::cli {
namespace {

std::atomic<bool> interrupt_seen{false};

extern "C" void on_interrupt(int signal) {
  if (interrupt_seen.exchange(true)) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
}

std::size_t terminal_columns() {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
  return 80;
}

/// Whoever reads may be gone (`2>&1 | head -1`): what cannot be said is dropped. A throw would end a push half way.
void put(FILE* stream, std::string_view text) { std::fwrite(text.data(), 1, text.size(), stream); }

constexpr double redraw_every_s = 0.1;
constexpr double time_left_after_s = 2.0;  // an extrapolation from less says nothing
constexpr double time_left_after_share = 0.03;

}  // namespace

void stop_on_interrupt() {
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
  // A terminal that is gone, with whoever was to watch the arm; `nohup` says that it may go on.
  if (std::signal(SIGHUP, on_interrupt) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);  // a reader that closed early is no reason to lose a result on disk
}

void hold_standard_streams() {
  for (int descriptor = open("/dev/null", O_RDWR); descriptor >= 0; descriptor = open("/dev/null", O_RDWR))
    if (descriptor > STDERR_FILENO) {
      close(descriptor);
      return;
    }
}

void end_at_first_interrupt() {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
  if (std::signal(SIGHUP, SIG_DFL) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
}

std::string stage_words(std::string_view stage) {
  constexpr std::pair<std::string_view, std::string_view> words[] = {
      {"read", "reading the recording"},
      {"press", "pressing the object"},
      {"rate pushes", "rating pushes"},
      {"unseen side", "trying other shapes of the unseen side"},
      {"lattice", "filling the object with tetrahedra"},
      {"quality", "improving the tetrahedra"},
      {"fit", "fitting"},
      {"paper's method", "fitting by the paper's method"},
      {"mesh error", "asking a finer mesh"},
      {"posterior", "exploring the posterior"},
      {"stress", "stresses"},
      {"cross-check", "checking the parts against each other"},
      {"other laws", "comparing laws of elasticity"},
      {"write", "writing"},
  };
  for (const auto& [name, said] : words) {
    if (name == stage) return std::string(said);
  }
  return std::string(stage);
}

std::optional<double> time_left_s(double elapsed_s, double share) {
  if (!(elapsed_s > time_left_after_s) || !(share > time_left_after_share) || !(share < 1)) return std::nullopt;
  return elapsed_s * (1 - share) / share;
}

bool Session::interrupted() { return interrupt_seen.load(); }

std::string duration(double seconds) {
  if (seconds < 10) return fmt::format("{:.1f} s", seconds);
  const long whole = std::lround(seconds);
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

int Session::thread_count() const {
  return palpate::thread_count(threads);
}

void Session::clear_line() {
  if (line_open_) std::fputs("\r\033[K", stderr);
  line_open_ = false;
}

void Session::say(std::string_view line) {
  if (quiet) return;
  const std::scoped_lock lock(mutex_);
  clear_line();
  put(stderr, fmt::format("{}\n", line));
}

void Session::announce(std::string_view line) {
  const std::scoped_lock lock(mutex_);
  clear_line();
  put(stderr, fmt::format("{}\n", line));
  std::fflush(stderr);
}

void Session::warn(std::string_view line) {
  const std::scoped_lock lock(mutex_);
  clear_line();
  put(stderr, fmt::format("warning: {}\n", line));
}

void Session::print(std::string_view text) {
  const std::scoped_lock lock(mutex_);
  put(stdout, text);
}

void Session::result(const nlohmann::json& object) {
  if (!json) return;
  const std::scoped_lock lock(mutex_);
  clear_line();
  // Names come from files and may be anything: bytes that are not UTF-8 are replaced, not fatal.
  put(stdout, object.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  std::fflush(stdout);
}

OnProgress Session::progress() {
  return [this](std::string_view stage, double share) { return draw(stage, share); };
}

bool Session::draw(std::string_view stage, double share) {
  if (quiet) return !interrupted();
  static const bool on_terminal = isatty(STDERR_FILENO) != 0;
  const auto now = std::chrono::steady_clock::now();
  const auto since = [&](auto then) { return std::chrono::duration<double>(now - then).count(); };
  const std::scoped_lock lock(mutex_);
  if (stage != stage_) {
    if (on_terminal && !stage_.empty() && line_open_) {
      clear_line();
      put(stderr, fmt::format("  {:<40} {}\n", stage_words(stage_), duration(since(stage_start_))));
    }
    stage_ = stage;
    stage_start_ = now;
    last_draw_ = {};
    if (!on_terminal) put(stderr, fmt::format("{} ...\n", stage_words(stage_)));
  }
  const bool finished = share >= 1.0;
  if (on_terminal && finished) {
    clear_line();
    put(stderr, fmt::format("  {:<40} {}\n", stage_words(stage_), duration(since(stage_start_))));
    stage_.clear();
  } else if (on_terminal && since(last_draw_) > redraw_every_s) {
    std::string line = fmt::format("  {:<40} {:3.0f} %", stage_words(stage_), 100 * std::fmax(share, 0.0));
    if (const auto left_s = time_left_s(since(stage_start_), share)) line += fmt::format("  about {} left", duration(*left_s));
    if (line.size() >= terminal_columns()) line.resize(terminal_columns() - 1);
    put(stderr, "\r\033[K" + line);
    std::fflush(stderr);
    line_open_ = true;
    last_draw_ = now;
  }
  return !interrupted();
}

}  // namespace palpate::cli
