// SPDX-License-Identifier: Apache-2.0
// One offline page that shows an answer, what it rests on and how far to trust it.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "palpate/core/identification.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::report {

struct ReportOptions {
  std::string title;                  ///< empty: the recording's name
  std::size_t max_bytes = 3'000'000;  ///< of the whole page; meshes and clouds are thinned to fit, and the page says so
  bool running = false;               ///< the work goes on: the answer is what is known so far, and nothing is final
};

/// The page as text. It refers to nothing outside itself. Names from the recording cannot break or script it.
/// @param recording  may be null: tools, supports and input hashes are then left out
std::string html(const Identification& identification, const Recording* recording, const ReportOptions& options = {});

/// Writes `html()` to `path`, whole or not at all.
/// @throws Error when the file cannot be written
void write_report(const Identification& identification, const Recording* recording, const std::filesystem::path& path,
                  const ReportOptions& options = {});

/// The data that `html()` puts into the page, as JSON text (ASCII).
std::string page_data(const Identification& identification, const Recording* recording, const ReportOptions& options = {});

/// The same page without data: it asks the server that it came from for `state` (JSON: `stage`, `share`, `time_left_s` or null,
/// `version` of the data, `finished`, `message`), and for `data` (what page_data gives) whenever the version is a new one.
std::string live_page();

/// The page's data as JSON text, from a page that write_report wrote.
/// @throws Error when the file is no such page
std::string read_report_data(const std::filesystem::path& path);

}  // namespace palpate::report
