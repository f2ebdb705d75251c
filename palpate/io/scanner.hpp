// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

namespace palpate::io {

/// The number that `text` spells, all of it and whatever the locale; nothing else counts ("3 mm" does not). May be NaN.
std::optional<double> parse_number(std::string_view text);
std::optional<std::int64_t> parse_whole(std::string_view text);
std::string_view trimmed(std::string_view text);

/// Walks through the bytes of a file, text and binary mixed. Every failure is an Error that names file and line.
class Scanner {
 public:
  /// `bytes` must outlive the scanner; `name` stands in the messages.
  Scanner(std::string_view bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}

  bool at_end();                 ///< skips white space first
  std::string_view peek_word();  ///< empty at the end
  std::string_view word(std::string_view what);
  double number(std::string_view what);  ///< finite
  std::int64_t whole(std::string_view what, std::int64_t least = std::numeric_limits<std::int64_t>::min(),
                     std::int64_t most = std::numeric_limits<std::int64_t>::max());
  /// A number of things that follow, at least `bytes_each` bytes each: more than the file can hold is refused before any
  /// memory is asked for.
  std::size_t count(std::string_view what, std::size_t bytes_each = 2);
  void check_count(std::size_t things, std::string_view what, std::size_t bytes_each) const;
  void expect(std::string_view word);
  std::string_view line();  ///< up to the line's end, which is eaten (LF or CR LF)
  std::string_view take(std::size_t size, std::string_view what);
  std::size_t remaining() const { return bytes_.size() - at_; }
  std::size_t position() const { return at_; }
  void seek(std::size_t position) { at_ = position; }
  std::string_view bytes() const { return bytes_; }
  const std::string& name() const { return name_; }
  std::string where() const;  ///< "file:line"
  [[noreturn]] void fail(const std::string& what) const;

 private:
  void skip_blanks();
  std::string_view bytes_;
  std::string name_;
  std::size_t at_ = 0;
};

}  // namespace palpate::io
