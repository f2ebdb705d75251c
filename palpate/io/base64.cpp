// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/base64.hpp"

#include <array>
#include <cstdint>

namespace palpate::io {
namespace {

constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

constexpr std::array<std::int8_t, 256> value_of_letter = [] {
  std::array<std::int8_t, 256> table{};
  table.fill(-1);
  for (std::size_t i = 0; i < alphabet.size(); ++i)
    table[static_cast<unsigned char>(alphabet[i])] = static_cast<std::int8_t>(i);
  return table;
}();

}  // namespace

std::string base64_encoded(std::string_view bytes) {
  std::string result;
  result.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = (group << 8) | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) result += i + k > bytes.size() ? '=' : alphabet[(group >> (18 - 6 * k)) & 63];
  }
  return result;
}

std::optional<std::string> base64_decoded(std::string_view text) {
  std::string result;
  result.reserve(text.size() / 4 * 3);
  std::uint32_t group = 0;
  int letters = 0;
  const auto flush = [&] {
    for (int k = 0; k < letters - 1; ++k) result += static_cast<char>((group >> (16 - 8 * k)) & 255);
    group = 0;
    letters = 0;
  };
  for (const char letter : text) {
    if (letter == ' ' || letter == '\n' || letter == '\r' || letter == '\t') continue;
    if (letter == '=') {
      flush();
      continue;
    }
    const int value = value_of_letter[static_cast<unsigned char>(letter)];
    if (value < 0) return std::nullopt;
    group |= static_cast<std::uint32_t>(value) << (18 - 6 * letters);
    if (++letters == 4) flush();
  }
  flush();
  return result;
}

}  // namespace palpate::io
