// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/scanner.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "palpate/core/error.hpp"

namespace palpate::io {
namespace {

bool is_blank(char letter) {
  return letter == ' ' || letter == '\t' || letter == '\n' || letter == '\r' || letter == '\f' || letter == '\v';
}

/// Something from a hostile file that is safe and short enough to be quoted.
std::string quoted(std::string_view text) {
  std::string result = "'";
  for (const char letter : text.substr(0, 40))
    result += static_cast<unsigned char>(letter) < 32 || letter == 127 ? '?' : letter;
  if (text.size() > 40) result += "...";
  return result + "'";
}

template <typename Number>
std::optional<Number> parse(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  Number value{};
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || end != text.data() + text.size()) return std::nullopt;
  if (code == std::errc::result_out_of_range) {
    // Denormals are as good as zero; what is too large is not a number that we can use.
    if constexpr (std::is_same_v<Number, double>) {
      const auto exponent = text.find_first_of("eE");
      if (exponent != std::string_view::npos && exponent + 1 < text.size() && text[exponent + 1] == '-') return 0.0;
    }
    return std::nullopt;
  }
  if (code != std::errc{}) return std::nullopt;
  return value;
}

}  // namespace

std::optional<double> parse_number(std::string_view text) { return parse<double>(text); }
std::optional<std::int64_t> parse_whole(std::string_view text) { return parse<std::int64_t>(text); }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

void Scanner::skip_blanks() {
  while (at_ < bytes_.size() && is_blank(bytes_[at_])) ++at_;
}

bool Scanner::at_end() {
  skip_blanks();
  return at_ == bytes_.size();
}

std::string_view Scanner::peek_word() {
  skip_blanks();
  std::size_t end = at_;
  while (end < bytes_.size() && !is_blank(bytes_[end])) ++end;
  return bytes_.substr(at_, end - at_);
}

std::string_view Scanner::word(std::string_view what) {
  const std::string_view result = peek_word();
  if (result.empty()) fail("the file ends where " + std::string(what) + " is expected; it is cut off, copy it again");
  at_ += result.size();
  return result;
}

double Scanner::number(std::string_view what) {
  const std::string_view text = word(what);
  const auto value = parse_number(text);
  if (!value) fail("expected " + std::string(what) + ", found " + quoted(text));
  if (!std::isfinite(*value)) fail(std::string(what) + " is " + std::string(text.substr(0, 10)) + ", not a finite number");
  return *value;
}

std::int64_t Scanner::whole(std::string_view what, std::int64_t least, std::int64_t most) {
  const std::string_view text = word(what);
  const auto value = parse_whole(text);
  if (!value) fail("expected " + std::string(what) + " (a whole number), found " + quoted(text));
  if (*value < least || *value > most) {
    fail(std::string(what) + " is " + std::to_string(*value) + ", it must lie between " + std::to_string(least) + " and " +
         std::to_string(most));
  }
  return *value;
}

void Scanner::check_count(std::size_t things, std::string_view what, std::size_t bytes_each) const {
  if (things > remaining() / std::max<std::size_t>(bytes_each, 1) + 1) {
    fail("announces " + std::to_string(things) + " as " + std::string(what) + ", more than the file's " +
         std::to_string(remaining()) + " remaining bytes can hold; it is cut off or damaged");
  }
}

std::size_t Scanner::count(std::string_view what, std::size_t bytes_each) {
  const auto value = static_cast<std::size_t>(whole(what, 0, std::numeric_limits<std::int32_t>::max()));
  check_count(value, what, bytes_each);
  return value;
}

void Scanner::expect(std::string_view wanted) {
  const std::string_view found = word(wanted);
  if (found != wanted) fail("expected '" + std::string(wanted) + "', found " + quoted(found));
}

std::string_view Scanner::line() {
  const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
  std::string_view result = bytes_.substr(at_, end - at_);
  at_ = std::min(end + 1, bytes_.size());
  if (!result.empty() && result.back() == '\r') result.remove_suffix(1);
  return result;
}

std::string_view Scanner::take(std::size_t size, std::string_view what) {
  if (size > remaining()) {
    fail("the file ends within " + std::string(what) + " (" + std::to_string(remaining()) + " of " + std::to_string(size) +
         " bytes left); it is cut off, copy it again");
  }
  const std::string_view result = bytes_.substr(at_, size);
  at_ += size;
  return result;
}

std::string Scanner::where() const {
  const auto line = 1 + std::count(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(at_), '\n');
  return name_ + ":" + std::to_string(line);
}

void Scanner::fail(const std::string& what) const { throw Error(what, where()); }

}  // namespace palpate::io
