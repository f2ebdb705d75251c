// SPDX-License-Identifier: Apache-2.0
// The lab's own mesh of a block: fine under a circular contact whose rim runs along element edges, coarse elsewhere.
#pragma once

#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::lab {

struct GradedBlockOptions {
  Vec3 min_m{-0.075, 0.0, 0.0};  ///< corners of the block (its plane y = min may be a plane of symmetry)
  Vec3 max_m{0.075, 0.075, 0.15};
  Vec3 contact_m{0.0, 0.0, 0.15};  ///< centre of the contact on the top face z = max (on y = min for a half block)
  double contact_radius_m = 0.015;
  int cells_in_radius = 3;  ///< element edges across the contact radius
  double growth = 1.35;     ///< ratio of neighbouring cells away from the contact
  double largest_cell_m = 0.01;
  double edge_cell_m = 0.004;  ///< at the walls and the foot: where a face is held stresses are singular along its edges
};

/// Linear tetrahedra (six a cell, mirrored at the contact's axis so that the split suits the round rim).
/// @throws Error when the contact does not lie on the top face with its whole radius (up to planes through its centre), or
/// an
///         option is out of range.
TetMesh graded_block(const GradedBlockOptions& options);

/// Nodes of the top face inside the contact, rim included. Works on the mesh itself and on its quadratic version.
std::vector<Index> contact_nodes(const TetMesh& mesh, const GradedBlockOptions& options);

}  // namespace palpate::lab
