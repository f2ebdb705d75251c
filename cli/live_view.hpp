// SPDX-License-Identifier: Apache-2.0
// The report's page while the work goes on: whoever knows the address can look, and only look. docs/live-view.md.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "cli/web_server.hpp"

namespace palpate::cli {

/// Threads may call at the same time.
class LiveView {
 public:
  /// Makes the page's data (report::page_data). Called on the server's thread, when somebody asks for them, at most once.
  using MakeData = std::function<std::string()>;

  /// Serves from here on. @param port  0: one that is free  @param page  report::live_page()
  /// @throws Error when the port is taken, or the address is none of this machine
  LiveView(const std::string& address, int port, std::string title, std::string page);

  /// "http://127.0.0.1:40123/6f2c.../": a new secret for every view.
  std::string url() const { return url_; }

  void progress(std::string_view stage, double share);
  /// What is known so far; replaces what was said before.
  void update(MakeData data);
  /// The last data and a last word. Where somebody has looked lately, waits until the page has them, at most `patience`.
  void finish(MakeData data, std::string message, std::chrono::milliseconds patience = std::chrono::seconds(10));

 private:
  std::optional<WebServer::Content> answer(const std::string& path);
  std::string state();
  std::string data();

  std::string token_, title_, page_, url_;
  std::mutex mutex_;
  std::condition_variable asked_;
  std::string stage_ = "starting";
  double share_ = 0;
  std::chrono::steady_clock::time_point stage_start_{}, last_asked_{};
  std::int64_t version_ = 0, made_version_ = -1, sent_version_ = -1;
  MakeData make_;
  std::string made_;
  bool finished_ = false;
  std::string message_;
  WebServer server_;  // last: it calls what stands above
};

}  // namespace palpate::cli
