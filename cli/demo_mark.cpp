// SPDX-License-Identifier: Apache-2.0
#include "cli/demo_mark.hpp"

#include <fmt/format.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* mark_name = "demo.json";
constexpr const char* mark_format = "palpate-demo/1";

/// What a demonstration replaces: relative to `out`, folders not among them.
std::vector<std::string> files_of_recording(const fs::path& out) {
  std::vector<std::string> names;
  if (fs::is_regular_file(out / "truth.json")) names.emplace_back("truth.json");
  if (!fs::exists(fs::symlink_status(out / "recording"))) return names;
  if (!fs::is_directory(fs::symlink_status(out / "recording"))) return {"recording"};  // a file or a link
  for (const auto& entry : fs::recursive_directory_iterator(out / "recording"))
    if (!fs::is_directory(entry.symlink_status())) names.push_back(entry.path().lexically_relative(out).generic_string());
  return names;
}

std::string hash_of(const fs::path& file) {
  return fs::is_regular_file(fs::symlink_status(file)) ? io::sha256_hex(io::read_file(file)) : std::string();
}

}  // namespace

void must_take_demo(const fs::path& out) {
  std::error_code code;
  if (!fs::exists(out, code) || fs::is_empty(out, code)) return;
  std::ifstream file(out / mark_name);
  const nlohmann::json mark = nlohmann::json::parse(file, nullptr, false);
  if (!mark.is_object() || mark.value("format", nlohmann::json()) != mark_format)
    throw Error("holds files that `palpate demo` did not write, and they stay; choose another folder, or remove it", out.string());
  const nlohmann::json files = mark.value("files", nlohmann::json::object());
  for (const std::string& name : files_of_recording(out)) {
    const auto known = files.find(name);
    if (known == files.end() || !known->is_string() || known->get<std::string>() != hash_of(out / name))
      throw Error("is not as `palpate demo` wrote it, and stays; choose another folder, or remove the file", (out / name).string());
  }
}

void mark_demo(const fs::path& out) {
  nlohmann::json mark = {{"format", mark_format},
                         {"about", "`palpate demo` wrote these files; while they are as they were, its next run here replaces them"},
                         {"files", nlohmann::json::object()}};
  for (const std::string& name : files_of_recording(out)) mark["files"][name] = hash_of(out / name);
  io::write_file(out / mark_name, mark.dump(2) + "\n");
}

}  // namespace palpate::cli
