// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/vtk_cells.hpp"

namespace palpate::io {
namespace {

enum VtkType {
  vertex = 1,
  poly_vertex = 2,
  line = 3,
  poly_line = 4,
  triangle = 5,
  polygon = 7,
  quad = 9,
  tetra = 10,
  quadratic_edge = 21,
  quadratic_triangle = 22,
  quadratic_quad = 23,
  quadratic_tetra = 24
};

}  // namespace

void add_vtk_cells(const VtkCells& cells, const std::vector<std::int64_t>& types, MeshBuilder& builder,
                   const Scanner& file) {
  if (types.size() != cells.count()) {
    file.fail("has " + std::to_string(cells.count()) + " cells and " + std::to_string(types.size()) +
              " cell types; it is cut off or damaged");
  }
  std::vector<Index> nodes;
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const std::int64_t begin = cells.offsets[cell], end = cells.offsets[cell + 1];
    if (begin < 0 || end < begin || end > static_cast<std::int64_t>(cells.connectivity.size())) {
      file.fail("cell " + std::to_string(cell) + " has offsets outside the list of nodes");
    }
    nodes.clear();
    for (std::int64_t k = begin; k < end; ++k) {
      const std::int64_t node = cells.connectivity[static_cast<std::size_t>(k)];
      if (node < 0 || node >= static_cast<std::int64_t>(builder.points())) {
        file.fail("cell " + std::to_string(cell) + " refers to point " + std::to_string(node) + ", which is not there");
      }
      nodes.push_back(static_cast<Index>(node));
    }
    const auto need = [&](std::size_t least) {
      if (nodes.size() < least) file.fail("cell " + std::to_string(cell) + " has too few nodes");
    };
    switch (types[cell]) {
      case vertex:
      case poly_vertex:
      case line:
      case poly_line:
      case quadratic_edge:
        break;
      case triangle:
      case quadratic_triangle:
        need(3);
        builder.triangle(nodes[0], nodes[1], nodes[2]);
        break;
      case quad:
      case quadratic_quad:
        need(4);
        builder.polygon({nodes[0], nodes[1], nodes[2], nodes[3]});
        break;
      case polygon:
        need(3);
        builder.polygon(nodes);
        break;
      case tetra:
        need(4);
        builder.tetrahedron(nodes.data(), 4);
        break;
      case quadratic_tetra:
        need(10);
        builder.tetrahedron(nodes.data(), 10);
        break;
      default:
        file.fail("cell type " + std::to_string(types[cell]) +
                  " is not read: only triangles, quadrangles and tetrahedra of 4 or 10 nodes are");
    }
  }
}

}  // namespace palpate::io
