// SPDX-License-Identifier: Apache-2.0
// `--serve PORT` of verbs that fit: from the fit's own words to the page that shows them. Four lines for a verb:
//   LiveReport live(given->live, session, name);          after parsing
//   OnProgress progress = live.watch(session.progress());
//   options.fit.on_estimate = live.on_estimate(recording);
//   live.finish(answer, recording, where the report lies);
#pragma once

#include <memory>
#include <string>

#include "cli/live_view.hpp"
#include "cli/session.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/estimation/fit.hpp"

namespace CLI {
class App;
}

namespace palpate::cli {

struct LiveOptions {
  int port = -1;  ///< -1: nobody looks; 0: one that is free
  std::string address = "127.0.0.1";
  void add_to(CLI::App& app);
};

class LiveReport {
 public:
  /// Says the address where `options` ask for a view, and does nothing at all where they do not.
  /// @throws Error as LiveView does
  LiveReport(const LiveOptions& options, Session& session, const std::string& title);

  OnProgress watch(OnProgress progress);
  estimation::OnEstimate on_estimate(const Recording& recording);
  /// @param place  of the report on disk
  void finish(const Identification& answer, const Recording& recording, const std::string& place);

 private:
  std::unique_ptr<LiveView> view_;
};

}  // namespace palpate::cli
