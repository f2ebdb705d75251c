// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/geometry/lattice.hpp"
#include "palpate/geometry/tet_editor.hpp"

namespace palpate::geometry {

/// Inside of tetrahedralise: the part of the lattice within the solid, cut by marching tetrahedra. Its boundary is manifold
/// by construction, whatever the solid looks like; its elements may be thin.
TetEditor cut_lattice(const Lattice& lattice, const Solid& solid);

}  // namespace palpate::geometry
