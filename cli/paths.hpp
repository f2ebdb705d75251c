// SPDX-License-Identifier: Apache-2.0
// Paths that users type, checked before any work begins: what is wrong is said with the cure.
#pragma once

#include <filesystem>
#include <string>

namespace palpate::cli {

/// @param wanted  e.g. "a recording is a folder with recording.yaml in it, or a bag"
/// @throws Error when nothing is there; names what is called nearly so beside it
void must_exist(const std::filesystem::path& path, const std::string& wanted);

/// @throws Error when it is no folder that `palpate estimate -o` (or demo, explore) wrote, nor a file in one
void must_be_result(const std::filesystem::path& path);

/// The folder may be there or not: hours of work must not end at a closed door.
/// @throws Error when it, or what it would have to be made in, is no folder or cannot be written
void must_take_files(const std::filesystem::path& folder);

/// What is written into `folder` replaces model/, fit/ and figures/ in it.
/// @throws Error when the recording is one of these or lies in one, or is the folder itself
void must_leave_recording(const std::filesystem::path& folder, const std::filesystem::path& recording);

/// A file that is there is replaced, folders on the way to it are made.
/// @throws Error when it is a folder, or its folder cannot be written
void must_take_file(const std::filesystem::path& file);

}  // namespace palpate::cli
