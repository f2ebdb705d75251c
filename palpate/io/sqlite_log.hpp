// SPDX-License-Identifier: Apache-2.0
// A database whose recorder was killed: what it had written last lies in a write-ahead log beside it (rosbag2's storage preset
// `resilient`), perhaps the whole of it. sqlite.org/fileformat2.html, section 4. SQLite would fold the log in only by writing to
// the user's folder.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace palpate::io {

/// Puts every transaction that the log holds whole into the database, as SQLite would; what comes after the first damaged or
/// half-written one is lost to SQLite, too.
/// @returns how many bytes at the end of the log are of no whole transaction; nothing where it is no such log (`database` is left as it is)
std::optional<std::size_t> fold_in_log(std::string& database, std::string_view log);

}  // namespace palpate::io
