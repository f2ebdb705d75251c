// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sqlite_log.hpp"

#include <algorithm>
#include <map>

#include "palpate/io/bytes.hpp"

namespace palpate::io {
namespace {

constexpr std::size_t log_header = 32, frame_header = 24;
constexpr std::uint32_t log_magic = 0x377f0682;  // or one more: check sums over words whose first byte is the highest

std::uint32_t word(std::string_view bytes, std::size_t at) { return load<std::uint32_t>(bytes.data() + at, std::endian::big); }

/// Runs on from frame to frame.
struct CheckSum {
  std::endian order;
  std::uint32_t first = 0, second = 0;
  void add(std::string_view bytes) {
    for (std::size_t i = 0; i + 8 <= bytes.size(); i += 8) {
      first += load<std::uint32_t>(bytes.data() + i, order) + second;
      second += load<std::uint32_t>(bytes.data() + i + 4, order) + first;
    }
  }
  bool is(std::string_view bytes, std::size_t at) const { return first == word(bytes, at) && second == word(bytes, at + 4); }
};

}  // namespace

std::optional<std::size_t> fold_in_log(std::string& database, std::string_view log) {
  if (log.size() < log_header || (word(log, 0) | 1U) != (log_magic | 1U)) return std::nullopt;
  const std::size_t page = word(log, 8);
  CheckSum sum{(word(log, 0) & 1U) != 0 ? std::endian::big : std::endian::little};
  sum.add(log.substr(0, 24));
  if (!sum.is(log, 24) || page < 512 || page > 65536 || (page & (page - 1)) != 0) return std::nullopt;
  std::map<std::uint32_t, std::string_view> pages;  // of the transaction that is being read
  std::size_t folded = log_header, end = log.size();
  for (std::size_t at = log_header; at + frame_header + page <= log.size(); at += frame_header + page) {
    const std::uint32_t number = word(log, at), pages_after = word(log, at + 4);
    const std::string_view content = log.substr(at + frame_header, page);
    sum.add(log.substr(at, 8));
    sum.add(content);
    if (log.substr(at + 8, 8) != log.substr(16, 8)) {  // an earlier round of the log, which is in the database
      end = at;
      break;
    }
    if (number == 0 || !sum.is(log, at + 16)) break;
    pages[number] = content;
    if (pages_after == 0) continue;
    // No page of a real log is far beyond the database and the log itself.
    if (pages_after > (database.size() + log.size()) / page + 1) break;
    database.resize(page * pages_after, '\0');
    for (const auto& [place, bytes] : pages)
      if (place <= pages_after) std::copy(bytes.begin(), bytes.end(), database.begin() + static_cast<std::ptrdiff_t>(page * (place - 1)));
    pages.clear();
    folded = at + frame_header + page;
  }
  return end - folded;
}

}  // namespace palpate::io
