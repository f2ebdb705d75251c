// SPDX-License-Identifier: Apache-2.0
// The parsers behind bag_formats(). Inner header of the room `io`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "palpate/io/message_source.hpp"

namespace palpate::io {

/// mcap.dev/spec
MessageSource parse_mcap_bag(std::string bytes, const std::string& name);
/// wiki.ros.org/Bags/Format/2.0
MessageSource parse_ros1_bag(std::string bytes, const std::string& name);
/// rosbag2_storage_sqlite3: tables `topics` and `messages`
MessageSource parse_sqlite_bag(std::string bytes, const std::string& name);

/// Says of a file that was cut off where that was.
/// @param within  first byte of the record that is not whole
std::string cut_off_warning(std::size_t file_bytes, std::size_t within, std::optional<std::int64_t> first_ns,
                            std::optional<std::int64_t> last_ns);

}  // namespace palpate::io
