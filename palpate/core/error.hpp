// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace palpate {

/// No answer can exist: bad file, broken mesh, bad option. `where` names the file, line and field (or the function's
/// argument), `what` says what is wrong and what to do about it. Numbers that did not work out are never an Error: they
/// are a field of the result.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& what, std::string where = {})
      : std::runtime_error(where.empty() ? what : where + ": " + what), where_(std::move(where)), message_(what) {}
  const std::string& where() const noexcept { return where_; }
  const std::string& message() const noexcept { return message_; }

 private:
  std::string where_;
  std::string message_;
};

}  // namespace palpate
