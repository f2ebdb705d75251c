// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/geometry/tetrahedralise.hpp"

namespace palpate::reconstruction {

/// Where a volume must be fine enough to be held as its surface is: at its feet on planes and tables, around what boxes hold.
std::vector<geometry::FinerNear> finer_at_supports(const std::vector<Support>& supports, const TriMesh& surface);

}  // namespace palpate::reconstruction
