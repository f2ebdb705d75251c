// SPDX-License-Identifier: Apache-2.0
// Regions out of where an object was pushed.
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::fem {

/// A region around every site that was pushed: its contacts, by the push's site, or by its name where no site is said.
/// @throws Error when a push has no force at a place.
std::vector<Region> regions_by_site(const Recording& recording);

}  // namespace palpate::fem
