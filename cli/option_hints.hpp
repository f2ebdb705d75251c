// SPDX-License-Identifier: Apache-2.0
// The library says which field is wrong; which option of the command line sets that field is known here alone.
#pragma once

#include <string>

#include "palpate/core/error.hpp"

namespace palpate::cli {

/// What the error says, and the option that cures it where there is one.
std::string with_option(const Error& error);

}  // namespace palpate::cli
