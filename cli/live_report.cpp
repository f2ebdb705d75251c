// SPDX-License-Identifier: Apache-2.0
#include "cli/live_report.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "palpate/report/report.hpp"

namespace palpate::cli {
namespace {

constexpr std::size_t live_bytes = 2'000'000;  // a page; what changes every few seconds is thinned more than what stays

/// What the page says of a recording, without its meshes and images: they stay where the fit reads them.
std::shared_ptr<const Recording> outline_of(const Recording& recording) {
  auto outline = std::make_shared<Recording>();
  outline->name = recording.name;
  outline->source = recording.source;
  outline->environment = recording.environment;
  outline->rest.state = recording.rest.state;
  outline->supports = recording.supports;
  outline->free = recording.free;
  outline->input_hashes = recording.input_hashes;
  outline->warnings = recording.warnings;
  for (const Tool& tool : recording.tools) {
    outline->tools.push_back(tool);
    outline->tools.back().mesh.reset();
  }
  return outline;
}

LiveView::MakeData data_of(const Identification& answer, std::shared_ptr<const Recording> outline, bool running) {
  return [answer = std::make_shared<const Identification>(answer), outline = std::move(outline), running] {
    report::ReportOptions options;
    options.running = running;
    if (running) options.max_bytes = live_bytes;
    return report::page_data(*answer, outline.get(), options);
  };
}

bool only_this_machine(const std::string& address) { return address.starts_with("127.") || address == "::1"; }

}  // namespace

void LiveOptions::add_to(CLI::App& app) {
  CLI::Option* serve = app.add_option("--serve", port, "show the report while it comes into being, in a browser on this machine; 0: any free port")
      ->type_name("PORT")
      ->check(CLI::Range(0, 65535).description(""));
  app.add_option("--serve-address", address, "with --serve: listen here instead; 0.0.0.0 lets other machines look")
      ->type_name("IP")
      ->needs(serve)
      ->capture_default_str();
}

LiveReport::LiveReport(const LiveOptions& options, Session& session, const std::string& title) {
  if (options.port < 0) return;
  view_ = std::make_unique<LiveView>(options.address, options.port, title, report::live_page());
  session.announce("live view          " + view_->url());
  if (!only_this_machine(options.address)) {
    session.warn("the live view is not encrypted: whoever reads its address on the network can look, too");
  }
}

OnProgress LiveReport::watch(OnProgress progress) {
  if (!view_) return progress;
  return [view = view_.get(), progress = std::move(progress)](std::string_view stage, double share) {
    view->progress(stage, share);
    return !progress || progress(stage, share);
  };
}

estimation::OnEstimate LiveReport::on_estimate(const Recording& recording) {
  if (!view_) return {};
  return [view = view_.get(), outline = outline_of(recording)](const Identification& so_far) {
    view->update(data_of(so_far, outline, true));
  };
}

void LiveReport::finish(const Identification& answer, const Recording& recording, const std::string& place) {
  if (!view_) return;
  view_->finish(data_of(answer, outline_of(recording), false), fmt::format("Finished. This page is whole, and lies in {}", place));
}

}  // namespace palpate::cli
