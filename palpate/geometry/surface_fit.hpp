// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/geometry/lattice.hpp"
#include "palpate/geometry/tet_editor.hpp"

namespace palpate::geometry {

/// Inside of tetrahedralise: moves boundary vertices so that the boundary triangles (not just their corners) lie on the
/// solid's surface in the least-squares sense, measured both ways along the surface's normals. Corners then lie slightly
/// outside of convex regions, volume is kept, and sharp edges attract vertices. A vertex moves only as far as the quality of
/// its elements stays above min(before, floor).
void fit_to_surface(TetEditor& mesh, const Solid& solid, const SurfaceSamples& samples, double floor_quality);

}  // namespace palpate::geometry
