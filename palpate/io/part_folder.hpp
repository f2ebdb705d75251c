// SPDX-License-Identifier: Apache-2.0
// A folder that is not whole yet. Inner header of the room `io`, and of the program.
#pragma once

#include <filesystem>

namespace palpate::io {

/// A new folder beside a target, of a name that nobody has: TARGET.part, TARGET.part2, ... It goes away with all that is in it
/// unless it became something.
class PartFolder {
 public:
  /// Makes the folders on the way to it. @throws Error when it cannot be made
  explicit PartFolder(const std::filesystem::path& target);
  PartFolder(const PartFolder&) = delete;
  PartFolder& operator=(const PartFolder&) = delete;
  ~PartFolder();

  const std::filesystem::path& path() const { return path_; }
  /// Takes the target's name, in place of nothing or of an empty folder. @throws Error when that cannot be
  void become(const std::filesystem::path& target);

 private:
  std::filesystem::path path_;
};

/// @throws Error naming `to`, which says what to do
void put_in_place(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace palpate::io
