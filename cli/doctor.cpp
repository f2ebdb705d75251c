// SPDX-License-Identifier: Apache-2.0
// `palpate doctor`: what an installation needs, each with the cure. Only what palpate itself needs can fail the check.
#include <fmt/core.h>
#include <unistd.h>

#include <Eigen/Core>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "cli/verbs.hpp"
#include "palpate/core/version.hpp"

namespace palpate::cli {
namespace {

struct Finding {
  std::string name;
  bool ok = true;
  bool needed = true;  ///< optional things that are missing do not fail the check
  std::string detail;
  std::string cure;
};

Finding build() {
#ifdef NDEBUG
  const bool optimised = true;
#else
  const bool optimised = false;
#endif
  const std::string eigen = fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION);
  return {"build", optimised, false, fmt::format("palpate {}, compiler {}, Eigen {}", version, __VERSION__, eigen),
          "this is a debug build, tens of times slower: configure with `cmake --preset release`"};
}

Finding threads() {
  const unsigned count = std::thread::hardware_concurrency();
  return {"threads", count > 0, false, fmt::format("{} available", count), "give --threads N"};
}

Finding memory() {
  const double bytes = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGE_SIZE));
  return {"memory", bytes > 2e9, false, fmt::format("{:.1f} GB", bytes / 1e9),
          "large meshes need more than 2 GB; keep to `--tetrahedra 20000`"};
}

Finding writable(const std::string& name, const std::filesystem::path& folder) {
  const std::filesystem::path probe = folder / fmt::format(".palpate-doctor-{}", getpid());
  bool written = false;
  {
    std::ofstream file(probe);
    file << "palpate" << std::flush;
    written = file.good();
  }
  std::error_code ignored;
  std::filesystem::remove(probe, ignored);
  return {name, written, true, folder.string(), "cannot write there; free some space, or set TMPDIR or change folder"};
}

Finding tool(const std::string& program, const std::string& used_for, const std::string& cure) {
  const char* path = std::getenv("PATH");
  std::string rest = path != nullptr ? path : "";
  while (!rest.empty()) {
    const std::size_t colon = rest.find(':');
    const std::filesystem::path file = std::filesystem::path(rest.substr(0, colon)) / program;
    if (access(file.c_str(), X_OK) == 0) return {program, true, false, file.string() + " (" + used_for + ")", ""};
    rest = colon == std::string::npos ? "" : rest.substr(colon + 1);
  }
  return {program, false, false, "not found; used for " + used_for, cure};
}

Finding python_module(const std::string& module, const std::string& used_for, const std::string& cure) {
  const std::string import = fmt::format("python3 -c 'import {}' >/dev/null 2>&1", module);
  const bool there = std::system(import.c_str()) == 0;
  return {module, there, false, there ? "python3 imports it (" + used_for + ")" : "python3 does not find it; used for " + used_for, cure};
}

int examine(Session& session) {
  std::error_code error;
  std::filesystem::path temporary = std::filesystem::temp_directory_path(error);
  if (error) temporary = "/tmp";
  const std::vector<Finding> findings = {
      build(),
      threads(),
      memory(),
      writable("temporary folder", temporary),
      writable("current folder", std::filesystem::current_path()),
      tool("ccx", "checking exports against CalculiX", "apt install calculix-ccx"),
      tool("python3", "converters in examples/", "apt install python3-numpy"),
      python_module("numpy", "converters in examples/", "apt install python3-numpy"),
      tool("node", "checking exports against MuJoCo", "apt install nodejs"),
  };
  bool healthy = true;
  nlohmann::json checks = nlohmann::json::array();
  for (const Finding& finding : findings) {
    healthy = healthy && (finding.ok || !finding.needed);
    const char* mark = finding.ok ? "ok     " : (finding.needed ? "FAILED " : "missing");
    session.say(fmt::format("{} {:<17} {}", mark, finding.name, finding.detail));
    if (!finding.ok) session.say(fmt::format("{:<25} -> {}", "", finding.cure));
    checks.push_back({{"name", finding.name},
                      {"ok", finding.ok},
                      {"needed", finding.needed},
                      {"detail", finding.detail},
                      {"cure", finding.ok ? "" : finding.cure}});
  }
  session.say(healthy ? "palpate is ready." : "palpate cannot work here until what FAILED is cured.");
  session.result({{"version", version}, {"healthy", healthy}, {"checks", checks}});
  return healthy ? exit_done : exit_numbers;
}

}  // namespace

Run verbs::doctor(CLI::App&) { return examine; }

}  // namespace palpate::cli
