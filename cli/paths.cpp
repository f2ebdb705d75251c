// SPDX-License-Identifier: Apache-2.0
#include "cli/paths.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <vector>

#include "cli/mistyped.hpp"
#include "palpate/core/error.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

/// "a/b/" and "a/b" are one place.
fs::path without_slash(const fs::path& path) {
  const fs::path clean = path.lexically_normal();
  return clean.filename().empty() && clean.has_relative_path() ? clean.parent_path() : clean;
}

std::string nearest_name(const fs::path& path) {
  const fs::path wanted = without_slash(path), folder = wanted.has_parent_path() ? wanted.parent_path() : fs::path(".");
  std::vector<std::string> names;
  std::error_code code;
  for (fs::directory_iterator entry(folder, code), end; !code && entry != end && names.size() < 1000; entry.increment(code)) {
    names.push_back(entry->path().filename().string());
  }
  const auto meant = did_you_mean(wanted.filename().string(), names);
  return meant ? fmt::format(" Did you mean `{}`?", (wanted.parent_path() / *meant).string()) : "";
}

}  // namespace

void must_exist(const fs::path& path, const std::string& wanted) {
  std::error_code code;
  if (path.empty()) throw Error("no path is given; " + wanted, "path");
  if (fs::exists(path, code)) return;
  if (code) throw Error(fmt::format("cannot be looked at ({}); {}", code.message(), wanted), path.string());
  std::string where;
  if (path.is_relative()) where = fmt::format(" (from {})", fs::current_path(code).string());
  throw Error(fmt::format("there is no such file or folder{}; {}.{}", where, wanted, nearest_name(path)), path.string());
}

void must_be_result(const fs::path& path) {
  const std::string wanted = "give the folder that `palpate estimate RECORDING -o FOLDER` wrote";
  must_exist(path, wanted);
  std::error_code code;
  const fs::path clean = without_slash(path);
  for (const fs::path& folder : {clean, clean.has_parent_path() ? clean.parent_path() : fs::path(".")}) {
    if (fs::is_regular_file(folder / "result.json", code)) return;
  }
  throw Error("holds no result.json; " + wanted, path.string());
}

void must_take_files(const fs::path& folder) {
  std::error_code code;
  fs::path there = fs::absolute(without_slash(folder), code);
  while (!fs::exists(there, code) && there.has_parent_path() && there != there.parent_path()) there = there.parent_path();
  const std::string which = there == fs::absolute(without_slash(folder), code) ? "" : there.string() + " ";
  if (!fs::is_directory(there, code)) {
    throw Error(which + "is a file, so nothing can be written into it; give the name of a folder", folder.string());
  }
  if (access(there.c_str(), W_OK | X_OK) != 0) {
    throw Error(which + "may not be written by you; give another folder, or change its permissions", folder.string());
  }
  // Some places refuse whoever may write: better known before the work than after it.
  fs::create_directories(folder, code);
  if (code) throw Error(fmt::format("cannot be made ({}); give another folder", code.message()), folder.string());
  for (fs::path made = fs::absolute(without_slash(folder)); made != there; made = made.parent_path())
    if (!fs::remove(made, code)) break;
}

void must_leave_recording(const fs::path& folder, const fs::path& recording) {
  std::error_code code;
  const fs::path within = fs::weakly_canonical(without_slash(recording), code).lexically_relative(fs::weakly_canonical(without_slash(folder), code));
  if (within.empty()) return;
  const std::string first = within.begin()->string();
  if (first == "." || first == "model" || first == "fit" || first == "figures")
    throw Error("would be overwritten by what is written into " + folder.string() + "; give another folder", recording.string());
}

void must_take_file(const fs::path& file) {
  std::error_code code;
  if (!file.has_filename() || fs::is_directory(file, code)) throw Error("is a folder; give the name of a file", file.string());
  must_take_files(file.has_parent_path() ? file.parent_path() : fs::path("."));
}

}  // namespace palpate::cli
