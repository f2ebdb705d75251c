// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/geometry/tetrahedralise.hpp"

namespace palpate::geometry {

/// Makes a filled object stand on a plane as its surface does, whatever the size of the elements: boundary faces that run along
/// the plane, within 0.15 of their longest edge and not beside the foot, are laid flat on it, and nodes around them go to the
/// outline of the surface's own faces in the plane, its corners first. Edges that the mesher cut off would else leave a foot
/// that is too small (a bar then seems to be on a soft base), and a round object one that is held too far out on one side. No
/// element loses more than four fifths of its volume.
/// @param least_quality  tet_quality that elements keep (0: only their volume counts); half of it where the foot would else lose a node
void stand_on(const Plane& plane, const TriMesh& surface, TetMesh& volume, double least_quality = 0);

/// Its first half alone, for surfaces whose foot has no outline that could be trusted; few elements become flatter
/// than 17 degrees for it, and none than 9.
void lay_on(const Plane& plane, TetMesh& volume, double least_quality = 0.3);

/// Where a volume must be fine enough to stand on a plane: over each foot of the surface in it, edges of an eighth of the foot's
/// size (the root of its area). A slender object else hangs on two or three elements.
std::vector<FinerNear> finer_at_feet(const Plane& plane, const TriMesh& surface);

}  // namespace palpate::geometry
