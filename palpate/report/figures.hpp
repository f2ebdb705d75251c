// SPDX-License-Identifier: Apache-2.0
// The page's figures as files for papers, drawn without a display from the data that the page carries.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace palpate::report {

/// A row of the table of figures.
struct Figure {
  std::string name;  ///< of its files
  std::string svg, png;
};

/// Every figure that the data allow (read_report_data); those without data are left out.
/// @throws Error when the text is no data of a report
std::vector<Figure> figures(const std::string& report_data);

/// Writes NAME.svg and NAME.png of each figure into `folder`, which is made. Returns the files.
/// @throws Error when a file cannot be written
std::vector<std::filesystem::path> write_figures(const std::string& report_data, const std::filesystem::path& folder);

}  // namespace palpate::report
