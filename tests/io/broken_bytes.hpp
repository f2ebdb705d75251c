// SPDX-License-Identifier: Apache-2.0
// What every reader must survive: bytes that are cut off, damaged, empty. It answers with a value or with an Error that
// names the file; anything else (another exception, a crash, a huge allocation) fails.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <random>
#include <string>
#include <vector>

#include "palpate/core/error.hpp"

namespace palpate::io::test {

using Reader = std::function<void(std::string_view bytes, const std::string& name)>;

/// True when the reader refused, with a message that names the file.
inline bool refuses(const Reader& read, std::string_view bytes) {
  try {
    read(bytes, "file.name");
    return false;
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("file.name"), std::string::npos) << error.what();
    EXPECT_GT(error.message().size(), 10u);
    return true;
  }
}

inline std::string with_crlf(const std::string& text) {
  std::string result;
  for (const char letter : text) {
    if (letter == '\n') result += '\r';
    result += letter;
  }
  return result;
}

/// Cut off at every eighth, and a byte before each of the eighths.
inline std::vector<std::string> truncated(const std::string& bytes) {
  std::vector<std::string> result;
  for (std::size_t eighth = 1; eighth < 8; ++eighth) {
    const std::size_t cut = bytes.size() * eighth / 8;
    result.push_back(bytes.substr(0, cut));
    result.push_back(bytes.substr(0, cut - 1));
  }
  return result;
}

/// Seeded damage: bytes replaced, runs removed and doubled, numbers blown up.
inline std::vector<std::string> damaged(const std::string& bytes, int count = 200) {
  std::mt19937 random(20100518);
  const auto below = [&](std::size_t most) { return std::uniform_int_distribution<std::size_t>(0, most - 1)(random); };
  std::vector<std::string> result;
  for (int i = 0; i < count; ++i) {
    std::string copy = bytes;
    for (std::size_t k = 0; k < 1 + below(4); ++k) {
      const std::size_t at = below(copy.size());
      switch (below(5)) {
        case 0:
          copy[at] = static_cast<char>(below(256));
          break;
        case 1:
          copy.erase(at, below(20));
          break;
        case 2:
          copy.insert(at, copy.substr(at, below(40)));
          break;
        case 3:
          copy[at] = "0129-.eE nN\n"[below(12)];
          break;
        default:
          copy.insert(at, "99999999");
          break;
      }
      if (copy.empty()) break;
    }
    result.push_back(copy);
  }
  return result;
}

inline std::vector<std::string> garbage() {
  std::mt19937 random(7);
  std::vector<std::string> result = {
      "", "\n", " \r\n \n", std::string(200, '\0'), "nan nan nan\n", "<?xml", "\xff\xfe\x00\x01"};
  for (int size = 1; size < 3000; size *= 3) {
    std::string noise(static_cast<std::size_t>(size), ' ');
    for (char& letter : noise) letter = static_cast<char>(random() & 0xff);
    result.push_back(noise);
  }
  return result;
}

/// No crash and no foreign exception on anything.
inline void survives(const Reader& read, const std::vector<std::string>& inputs) {
  for (const std::string& input : inputs) refuses(read, input);
}

}  // namespace palpate::io::test
