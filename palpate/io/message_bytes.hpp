// SPDX-License-Identifier: Apache-2.0
// The two ways in which ROS lays out a message. ROS 2: CDR (OMG CORBA 3.3, part 2, section 9.3; encapsulation of
// DDSI-RTPS): 4 bytes of header, then numbers aligned to their size, counted from the end of the header; texts end in NUL.
// ROS 1 (wiki.ros.org/msg): little endian, nothing aligned, no NUL. Apart from the header's `seq`, which ROS 2 dropped, the
// fields of the messages that we read are the same, so one decoder serves both.
#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <string_view>

#include "palpate/core/error.hpp"
#include "palpate/io/bytes.hpp"
#include "palpate/io/message_source.hpp"

namespace palpate::io {

class MessageReader {
 public:
  /// @throws Error when the message is of neither encoding.
  MessageReader(std::string_view message, MessageEncoding encoding, std::string where)
      : bytes_(message), where_(std::move(where)), is_cdr_(encoding == MessageEncoding::cdr) {
    if (encoding == MessageEncoding::other) fail("is encoded neither as CDR nor in the way of ROS 1");
    if (!is_cdr_) return;
    if (message.size() < 4 || message[0] != 0 || (message[1] != 0 && message[1] != 1)) fail("is not encoded as plain CDR");
    order_ = message[1] == 1 ? std::endian::little : std::endian::big;
    bytes_ = message.substr(4);
  }
  bool is_cdr() const { return is_cdr_; }
  template <typename T>
  T number() {
    if (is_cdr_) at_ = (at_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    return load<T>(raw(sizeof(T)).data(), order_);
  }
  std::string text() {
    const auto size = number<std::uint32_t>();
    const std::string_view all = raw(size);
    return std::string(is_cdr_ && size > 0 ? all.substr(0, size - 1) : all);
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
  [[noreturn]] void fail(const std::string& what) const { throw Error("the message " + what, where_); }

 private:
  std::string_view bytes_;
  std::string where_;
  std::size_t at_ = 0;
  std::endian order_ = std::endian::little;
  bool is_cdr_ = true;
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
