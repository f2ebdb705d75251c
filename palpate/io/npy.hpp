// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "palpate/core/math.hpp"

namespace palpate::io {

bool is_npy(std::string_view bytes);

/// NumPy's .npy of one or two dimensions (one: a column), format versions 1 to 3, C order, little endian: float32, float64,
/// uint16, uint8, bool. Throws Error naming the file.
MatrixX parse_npy(std::string_view bytes, const std::string& name);

enum class NpyType { float32, float64 };

/// Rows x columns, or one dimension for a single column.
std::string npy_bytes(const MatrixX& values, NpyType type = NpyType::float32);

}  // namespace palpate::io
