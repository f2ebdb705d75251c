// SPDX-License-Identifier: Apache-2.0
// What tells the folder of an earlier demonstration from anybody else's: a list of the files that it wrote, with their hashes.
#pragma once

#include <filesystem>

namespace palpate::cli {

/// A demonstration may write into `out`: nothing is there, or all of what it would remove was written by one and is as it was.
/// @throws Error that names the file which somebody else wrote or changed
void must_take_demo(const std::filesystem::path& out);

/// Before anything is written, and again (with the files that a later demonstration may remove) once the recording is there.
void mark_demo(const std::filesystem::path& out);

}  // namespace palpate::cli
