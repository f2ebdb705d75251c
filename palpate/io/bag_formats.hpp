// SPDX-License-Identifier: Apache-2.0
// The parsers behind bag_formats(). Inner header of the room `io`.
#pragma once

#include <string>

#include "palpate/io/message_source.hpp"

namespace palpate::io {

/// mcap.dev/spec
MessageSource parse_mcap_bag(std::string bytes, const std::string& name);
/// wiki.ros.org/Bags/Format/2.0
MessageSource parse_ros1_bag(std::string bytes, const std::string& name);
/// rosbag2_storage_sqlite3: tables `topics` and `messages`
MessageSource parse_sqlite_bag(std::string bytes, const std::string& name);

}  // namespace palpate::io
