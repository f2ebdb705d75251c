// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

namespace palpate::cli {

/// A folder that is empty or not there yet. It goes away again (one that was there, or a link to one, is emptied) unless something came into it that is worth keeping: what a run
/// that got nowhere leaves must not stand in the way of the next one.
class NewFolder {
 public:
  explicit NewFolder(std::filesystem::path folder) : folder_(std::move(folder)) {
    std::error_code code;
    there_ = std::filesystem::exists(std::filesystem::symlink_status(folder_, code));
    kept_ = std::filesystem::exists(folder_, code) && !std::filesystem::is_empty(folder_, code);
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  ~NewFolder() {
    std::error_code ignored;
    if (kept_) return;
    if (!there_) {
      std::filesystem::remove_all(folder_, ignored);
      return;
    }
    std::vector<std::filesystem::path> left;
    for (std::filesystem::directory_iterator at(folder_, ignored), end; !ignored && at != end; at.increment(ignored))
      left.push_back(at->path());
    for (const std::filesystem::path& one : left) std::filesystem::remove_all(one, ignored);
  }
  void keep() { kept_ = true; }

 private:
  std::filesystem::path folder_;
  bool there_ = false, kept_ = false;
};

}  // namespace palpate::cli
