// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "palpate/core/math.hpp"

namespace palpate::io {

/// A depth image in metres from a 16-bit grey PNG or an .npy array (uint16, float32, float64), told apart by the content.
/// 0, and NaN or infinity in a float array, mean no data (0 in the result). Throws Error naming the file on anything that is
/// cut off, of another kind, negative or empty.
DepthImage parse_depth(std::string_view bytes, const std::string& name, double depth_unit_m);

/// 1 where the mask is non-zero. PNG of any kind of grey or palette, or .npy of bool or uint8.
MaskImage parse_mask(std::string_view bytes, const std::string& name);

/// 16-bit PNG; a depth is rounded to a multiple of `depth_unit_m`. Throws Error when one exceeds 65535 units.
std::string depth_png(const DepthImage& depth_m, double depth_unit_m);
std::string mask_png(const MaskImage& mask);
/// float32 in metres, exact.
std::string depth_npy(const DepthImage& depth_m);

}  // namespace palpate::io
