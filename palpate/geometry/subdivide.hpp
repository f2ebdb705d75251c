// SPDX-License-Identifier: Apache-2.0
// Finer triangles on the same surface.
#pragma once

#include <functional>

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

/// Halves edges until no triangle's longest is longer than `edge_m` of its middle, so that the surface can follow a dent as well
/// as the elements under it do: a triangle's longest first and both of its triangles at once (Rivara 1984), so that no crack
/// opens and no angle falls below half of the smallest. A surface that is fine already stays as it is. The given vertices come
/// first. Ends above 60 000 triangles.
TriMesh subdivided(TriMesh surface, const std::function<double(const Vec3&)>& edge_m);

}  // namespace palpate::geometry
