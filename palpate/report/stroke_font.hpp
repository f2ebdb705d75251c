// SPDX-License-Identifier: Apache-2.0
// Letters as strokes, so that pictures need no font on the machine and look the same everywhere.
#pragma once

#include <array>
#include <string_view>

namespace palpate::report {

/// Printable ASCII, from the space on. See stroke_font.cpp for the encoding.
extern const std::array<std::string_view, 95> stroke_glyphs;

}  // namespace palpate::report
