// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/file.hpp"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <system_error>

#include "palpate/core/error.hpp"

namespace palpate::io {

namespace fs = std::filesystem;

std::string read_file(const fs::path& path) {
  std::error_code code;
  if (!fs::exists(path, code))
    throw Error("there is no such file; check its name, and the folder that it is in", path.string());
  if (fs::is_directory(path, code)) throw Error("is a folder, a file is expected", path.string());
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw Error("cannot be opened; check its permissions", path.string());
  std::string bytes((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  if (stream.bad()) throw Error("cannot be read to its end", path.string());
  return bytes;
}

void write_file(const fs::path& path, std::string_view bytes) {
  fs::path part = path;
  part += ".part";
  {
    std::ofstream stream(part, std::ios::binary | std::ios::trunc);
    if (!stream) throw Error("cannot be written; check that its folder exists and may be written to", path.string());
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    stream.flush();
    if (!stream) {
      stream.close();
      std::error_code code;
      fs::remove(part, code);
      throw Error("cannot be written; is the disk full?", path.string());
    }
  }
  std::error_code code, left;
  fs::rename(part, path, code);
  if (!code) return;
  fs::remove(part, left);
  throw Error("cannot be put in place: " + code.message() + "; remove what stands there, or write to another folder", path.string());
}

std::string extension_of(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
  return extension;
}

}  // namespace palpate::io
