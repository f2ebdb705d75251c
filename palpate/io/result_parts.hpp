// SPDX-License-Identifier: Apache-2.0
// Inner header of the room `io`.
#pragma once

#include <string>

#include "palpate/core/identification.hpp"

namespace palpate::io {

/// The part of a result that result.json holds. Throws Error.
Identification parse_result(const std::string& bytes, const std::string& name);

}  // namespace palpate::io
