// SPDX-License-Identifier: Apache-2.0
// The strip above a support that no sensor tells from the support itself. Of this room alone.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "palpate/reconstruction/facets.hpp"

namespace palpate::reconstruction {

/// Do the facets look to all sides, and their flanks that end within `height_m` of the plane, too? Without a plane: do they look
/// to all sides, up and down?
bool seen_from_all_around(const std::vector<Facet>& seen, const std::optional<Plane>& plane, double height_m);

/// Facets that go on from the lowest of what was seen, straight down to the plane: points closer to a table than the noise
/// are taken for the table, so flanks end above it. Only flanks that end within `height_m` of the plane go on, and not into
/// `free` space (which may be empty).
std::vector<Facet> skirts(const std::vector<Facet>& seen, const Plane& plane, double height_m, double cell_m,
                          const std::function<bool(const Vec3&)>& free);

}  // namespace palpate::reconstruction
