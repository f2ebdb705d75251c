// SPDX-License-Identifier: Apache-2.0
// Whole files in and out. Everything in this room parses from memory, so that every reader can be tested on broken bytes.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace palpate::io {

/// The file's bytes. Throws Error when there is no such file or it cannot be read.
std::string read_file(const std::filesystem::path& path);

/// Writes beside `path` and renames, so that a reader never sees half a file. Throws Error.
void write_file(const std::filesystem::path& path, std::string_view bytes);

/// Lower-case extension with its dot, ".ply".
std::string extension_of(const std::filesystem::path& path);

/// SHA-256 (FIPS 180-4) as 64 hexadecimal digits.
std::string sha256_hex(std::string_view bytes);

}  // namespace palpate::io
