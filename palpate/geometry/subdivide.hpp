// SPDX-License-Identifier: Apache-2.0
// Finer triangles on the same surface.
#pragma once

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

/// Splits every triangle in four until no edge is longer than `edge_m`, so that the surface can follow a dent as well as the
/// elements under it do; a surface that is fine already stays as it is. Ends at 60 000 triangles.
TriMesh subdivided(TriMesh surface, double edge_m);

}  // namespace palpate::geometry
