// SPDX-License-Identifier: Apache-2.0
// `palpate report OUT`: the figures of a result as SVG and PNG files, drawn without a display.
#include "palpate/report/report.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "cli/paths.hpp"
#include "cli/verbs.hpp"
#include "palpate/report/figures.hpp"

namespace palpate::cli {

Run verbs::report(CLI::App& app) {
  struct Options {
    std::string result;
    std::string folder;
  };
  auto options = std::make_shared<Options>();
  app.add_option("RESULT", options->result,
                 "folder that `palpate estimate -o` or `palpate demo -o` wrote, or its report.html")
      ->required();
  app.add_option("--png", options->folder, "folder for the figures; default: RESULT/figures")->type_name("DIR");
  return [options](Session& session) {
    namespace fs = std::filesystem;
    fs::path page = options->result;
    must_exist(page, "give the folder that `palpate estimate RECORDING -o FOLDER` wrote");
    if (fs::is_directory(page)) page /= "report.html";
    const fs::path folder = options->folder.empty() ? page.parent_path() / "figures" : fs::path(options->folder);
    must_take_files(folder);
    const auto files = palpate::report::write_figures(palpate::report::read_report_data(page), folder);
    nlohmann::json names = nlohmann::json::array();
    for (const fs::path& file : files) {
      names.push_back(file.string());
      session.say(file.string());
    }
    session.result({{"report", page.string()}, {"figures", names}});
    return exit_done;
  };
}

}  // namespace palpate::cli
