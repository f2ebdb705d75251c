// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "palpate/io/mesh_builder.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate::io {

/// Cell i has the nodes connectivity[offsets[i] .. offsets[i + 1]).
struct VtkCells {
  std::vector<std::int64_t> offsets, connectivity;
  std::size_t count() const { return offsets.empty() ? 0 : offsets.size() - 1; }
};

/// Hands triangles, quadrangles, polygons and tetrahedra (linear and quadratic) to the builder; points and lines are passed
/// over, other volumes are refused. VTK's order of a quadratic tetrahedron is ours.
void add_vtk_cells(const VtkCells& cells, const std::vector<std::int64_t>& types, MeshBuilder& builder, const Scanner& file);

}  // namespace palpate::io
