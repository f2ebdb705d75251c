// SPDX-License-Identifier: Apache-2.0
// Inside of Solid: lids for the small holes of a surface.
#pragma once

#include <array>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

struct HoleCovers {
  std::vector<Eigen::Matrix<Index, 1, 3>> triangles;
  std::vector<double> width_m;  ///< of the hole that each triangle covers: four times its area over its rim
};

/// Closes loops of edges that have one triangle, shortest loops first, each by the triangulation of least area (Barequet,
/// Sharir 1995). What would cover more than 0.7 of a connected part's area is left open: such a loop is the part's own rim.
/// @param mesh  oriented and welded
/// @param open  the ends of all edges that have one triangle, and that triangle
HoleCovers cover_holes(const TriMesh& mesh, const std::vector<std::array<Index, 3>>& open);

}  // namespace palpate::geometry
