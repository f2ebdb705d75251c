// SPDX-License-Identifier: Apache-2.0
// The fused surface where no facet is near. Of this room alone.
#pragma once

#include <functional>
#include <optional>

#include "palpate/core/mesh.hpp"
#include "palpate/reconstruction/facets.hpp"

namespace palpate::reconstruction {

/// Lets patches go on from the seen surface without a bend: they take the shape of least bending energy between what is around
/// them (Botsch and Kobbelt 2004, "An intuitive framework for real-time freeform modeling"). A surface where a winding number
/// passes one half spans a gap like a skin, which stands out of creases and flattens what bulges.
/// @param surface  closed. Its vertices that are `reach_m` and more from every facet's middle move, and their neighbours: at the
///                 rim of what was seen the winding number has a part in where they are. Parts that no facet holds stay
/// @param facets   points are facets' middles; cells at least `reach_m` wide
/// @param free     says of a place that a sensor looked through it: no vertex moves there; may be empty
/// @param support  where given: vertices on it stay, and none moves behind it
void smooth_unseen_patches(TriMesh& surface, const Grid& facets, double reach_m, const std::function<bool(const Vec3&)>& free,
                          const std::optional<Plane>& support = std::nullopt);

}  // namespace palpate::reconstruction
