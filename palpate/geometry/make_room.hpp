// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

/// Moves inner nodes after nodes of the boundary were moved: beside elements that became worse than `least_quality` (tet_quality), and
/// than they were, each goes to where the worst of the elements around it is best. A foot that is laid on its plane leaves too
/// little room above it, or too much: of meshes with good elements, a bear's lost the end of a leg, which stayed half a
/// millimetre above the table.
/// @param faces  the boundary, in the volume's numbering
/// @param before  nodes before the move
void make_room(const Triangles& faces, const Points& before, double least_quality, TetMesh& volume);

}  // namespace palpate::geometry
