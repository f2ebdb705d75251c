// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace palpate::io {

/// A packed block whose size is known beforehand. Compression is "" or "none", "zstd", "lz4" (frame format), "bz2". Nothing
/// when it is of another kind, damaged, or not of that size.
std::optional<std::string> unpack(std::string_view packed, const std::string& compression, std::uint64_t size);

/// What a packed block that was cut off still gives, from its beginning, perhaps nothing. At most `size` bytes.
std::string unpack_what_is_left(std::string_view packed, const std::string& compression, std::uint64_t size);

/// A zstd frame, or several, of unknown size; nothing when damaged.
std::optional<std::string> unpack_zstd(std::string_view packed);

}  // namespace palpate::io
