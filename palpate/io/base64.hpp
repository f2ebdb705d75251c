// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace palpate::io {

std::string base64_encoded(std::string_view bytes);

/// Blanks are skipped and padding may stand in the middle (VTK encodes a header apart from its data). Nothing on a letter
/// that is not base64.
std::optional<std::string> base64_decoded(std::string_view text);

}  // namespace palpate::io
