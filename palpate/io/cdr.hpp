// SPDX-License-Identifier: Apache-2.0
// CDR as ROS 2 writes it (OMG CORBA 3.3, part 2, section 9.3; encapsulation of DDSI-RTPS): 4 bytes of header, then numbers
// aligned to their size, counted from the end of the header.
#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <string_view>

#include "palpate/core/error.hpp"
#include "palpate/io/bytes.hpp"

namespace palpate::io {

class CdrReader {
 public:
  CdrReader(std::string_view message, std::string where) : where_(std::move(where)) {
    if (message.size() < 4 || message[0] != 0 || (message[1] != 0 && message[1] != 1)) fail("is not encoded as plain CDR");
    order_ = message[1] == 1 ? std::endian::little : std::endian::big;
    bytes_ = message.substr(4);
  }
  template <typename T>
  T number() {
    at_ = (at_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    return load<T>(raw(sizeof(T)).data(), order_);
  }
  std::string text() {
    const auto size = number<std::uint32_t>();
    const std::string_view all = raw(size);
    return std::string(size > 0 ? all.substr(0, size - 1) : all);  // ends in NUL
  }
  /// Length of a sequence whose items take at least `bytes_each`.
  std::size_t count(std::size_t bytes_each) {
    const auto size = number<std::uint32_t>();
    if (size > (bytes_.size() - at_) / bytes_each) fail("announces more items than it can hold");
    return size;
  }
  std::string_view raw(std::size_t size) {
    if (at_ > bytes_.size() || size > bytes_.size() - at_) fail("ends too early");
    const std::string_view result = bytes_.substr(at_, size);
    at_ += size;
    return result;
  }
  std::string_view octets() { return raw(count(1)); }
  std::endian order() const { return order_; }
  [[noreturn]] void fail(const std::string& what) const { throw Error("the message " + what, where_); }

 private:
  std::string_view bytes_;
  std::string where_;
  std::size_t at_ = 0;
  std::endian order_ = std::endian::little;
};

class CdrWriter {
 public:
  template <typename T>
  CdrWriter& number(T value) {
    const std::size_t at = out_.size() - 4;
    out_.append((sizeof(T) - at % sizeof(T)) % sizeof(T), '\0');
    store(out_, value);
    return *this;
  }
  CdrWriter& text(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size() + 1));
    out_ += value;
    out_ += '\0';
    return *this;
  }
  CdrWriter& octets(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size()));
    out_ += value;
    return *this;
  }
  std::string take() { return std::move(out_); }

 private:
  std::string out_ = std::string("\0\1\0\0", 4);  // little endian
};

}  // namespace palpate::io
