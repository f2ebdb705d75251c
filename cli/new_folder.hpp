// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <system_error>
#include <utility>

namespace palpate::cli {

/// A folder that is empty or not there yet. It goes away again unless something came into it that is worth keeping: what a run
/// that got nowhere leaves must not stand in the way of the next one.
class NewFolder {
 public:
  explicit NewFolder(std::filesystem::path folder) : folder_(std::move(folder)) {
    std::error_code code;
    there_ = std::filesystem::exists(folder_, code);
    kept_ = there_ && !std::filesystem::is_empty(folder_, code);
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  ~NewFolder() {
    std::error_code ignored;
    if (kept_) return;
    std::filesystem::remove_all(folder_, ignored);
    if (there_) std::filesystem::create_directory(folder_, ignored);
  }
  void keep() { kept_ = true; }

 private:
  std::filesystem::path folder_;
  bool there_ = false, kept_ = false;
};

}  // namespace palpate::cli
