// SPDX-License-Identifier: Apache-2.0
// What a call refuses, for tests of bad input.
#pragma once

#include <string>

#include "palpate/core/error.hpp"

namespace palpate {

/// What the error thrown by `call` says; "nothing thrown" without one.
template <class Call>
std::string message_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing thrown";
}

/// Whether `use` refuses these options once `change` has been made to them.
template <class Use, class Options, class Change>
bool refuses(Use use, Options options, Change change) {
  change(options);
  try {
    use(options);
  } catch (const Error&) {
    return true;
  }
  return false;
}

}  // namespace palpate
