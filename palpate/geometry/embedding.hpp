// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

/// Ties every row of `points_m` to the tetrahedron that contains it, or else to the nearest one, by barycentric weights
/// (they extrapolate outside). Any affine motion of the nodes moves the points exactly. Elements without volume are passed
/// over.
/// @throws Error when the volume has no usable element or a point is not finite.
SurfaceEmbedding embed(const Points& points_m, const TetMesh& volume);

/// Positions (or displacements) of the embedded points for nodal values: N x 3 from n x 3.
Points embedded_points(const SurfaceEmbedding& embedding, const TetMesh& volume, const Points& nodal_values);

}  // namespace palpate::geometry
