// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/geometry/tetrahedralise.hpp"

namespace palpate::geometry {

/// Where a volume must be fine enough to be held by what of it is in a box: along each rim in which the surface goes through the
/// box's sides, edges of an eighth of what the rim goes around (the root of a circle's area of its length). Nodes in the box end
/// up to an edge short of its sides: legs glued for a finger's width else are that much longer, and E comes out too low.
/// @param surface  base frame, m
std::vector<FinerNear> finer_at_rims(const Vec3& box_min_m, const Vec3& box_max_m, const TriMesh& surface);

}  // namespace palpate::geometry
