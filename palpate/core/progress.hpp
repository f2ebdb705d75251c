// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string_view>

namespace palpate {

/// Called now and then by long work with the stage's name and the share of it that is done (0 to 1).
/// Returning false asks the work to stop; it then ends with Termination::cancelled.
using OnProgress = std::function<bool(std::string_view stage, double share)>;

}  // namespace palpate
