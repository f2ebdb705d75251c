// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "palpate/core/math.hpp"

namespace palpate::fem {

/// An index of Eigen's for a container of the standard library's.
constexpr std::size_t at(Index i) { return static_cast<std::size_t>(i); }

}  // namespace palpate::fem
