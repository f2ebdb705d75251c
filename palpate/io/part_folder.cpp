// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/part_folder.hpp"

#include <string>
#include <system_error>

#include "palpate/core/error.hpp"

namespace palpate::io {

namespace fs = std::filesystem;

PartFolder::PartFolder(const fs::path& target) {
  std::error_code code;
  if (target.has_parent_path()) fs::create_directories(target.parent_path(), code);
  for (int number = 1; number < 1000; ++number) {
    fs::path name = target;
    name += number == 1 ? ".part" : ".part" + std::to_string(number);
    // Says no where something stands already, whoever made it.
    if (fs::create_directory(name, code)) {
      path_ = name;
      return;
    }
    if (code && code != std::errc::file_exists) break;
  }
  throw Error("cannot be made; check the name and the permissions", target.string());
}

PartFolder::~PartFolder() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

void PartFolder::become(const fs::path& target) {
  put_in_place(path_, target);
  path_.clear();
}

void put_in_place(const fs::path& from, const fs::path& to) {
  std::error_code code;
  fs::rename(from, to, code);
  if (code) throw Error("cannot be put in place: " + code.message() + "; remove what stands there, or write to another folder", to.string());
}

}  // namespace palpate::io
