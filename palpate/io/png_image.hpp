// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::io {

/// Grey image, 8 or 16 bits.
struct GreyImage {
  int width = 0, height = 0, bits = 8;
  std::vector<std::uint16_t> pixels;  ///< row by row
};

/// Throws Error naming the file: not a PNG, cut off, damaged, or colour.
GreyImage parse_png(std::string_view bytes, const std::string& name);
std::string png_bytes(const GreyImage& image);

}  // namespace palpate::io
