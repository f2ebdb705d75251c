// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

namespace palpate::io {

/// A number of type T in the file's byte order; `bytes` holds at least sizeof(T).
template <typename T>
T load(const char* bytes, std::endian order = std::endian::little) {
  char raw[sizeof(T)];
  std::memcpy(raw, bytes, sizeof(T));
  if (order != std::endian::native) std::reverse(raw, raw + sizeof(T));
  T value;
  std::memcpy(&value, raw, sizeof(T));
  return value;
}

template <typename T>
void store(std::string& out, T value, std::endian order = std::endian::little) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if (order != std::endian::native) std::reverse(raw, raw + sizeof(T));
  out.append(raw, sizeof(T));
}

/// Walks through the fields of a record; asking for more than there is sets `good` to false and gives zeros.
class ByteFields {
 public:
  explicit ByteFields(std::string_view bytes) : bytes_(bytes) {}
  template <typename T>
  T number() {
    const std::string_view raw = take(sizeof(T));
    return good ? load<T>(raw.data()) : T{};
  }
  std::string_view view() { return take(number<std::uint32_t>()); }
  std::string text() { return std::string(view()); }
  std::string_view take(std::uint64_t size) {
    if (size > bytes_.size() - at_) {
      good = false;
      return {};
    }
    const std::string_view result = bytes_.substr(at_, size);
    at_ += size;
    return result;
  }
  std::string_view rest() { return take(bytes_.size() - at_); }
  std::size_t position() const { return at_; }
  bool at_end() const { return at_ == bytes_.size(); }
  bool good = true;

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
};

}  // namespace palpate::io
