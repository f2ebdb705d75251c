// SPDX-License-Identifier: Apache-2.0
// CalculiX / Abaqus input deck: nodes and elements (C3D4, C3D10, S3), written only. Our order of a quadratic tetrahedron is
// that of C3D10 (edges 01 12 02 03 13 23).
#include <fmt/format.h>

#include "palpate/io/mesh_formats.hpp"

namespace palpate::io {

std::string write_calculix(const MeshData& mesh) {
  std::string out = "** palpate, SI units: metres, newtons, pascals, kg\n*NODE, NSET=ALL\n";
  for (Eigen::Index i = 0; i < mesh.points_m.rows(); ++i) {
    fmt::format_to(std::back_inserter(out), "{}, {}, {}, {}\n", i + 1, mesh.points_m(i, 0), mesh.points_m(i, 1),
                   mesh.points_m(i, 2));
  }
  const auto elements = [&](const auto& cells, const char* type, const char* set, Eigen::Index first) {
    if (cells.rows() == 0) return;
    fmt::format_to(std::back_inserter(out), "*ELEMENT, TYPE={}, ELSET={}\n", type, set);
    for (Eigen::Index i = 0; i < cells.rows(); ++i) {
      fmt::format_to(std::back_inserter(out), "{}", first + i + 1);
      for (Eigen::Index k = 0; k < cells.cols(); ++k) fmt::format_to(std::back_inserter(out), ", {}", cells(i, k) + 1);
      out += '\n';
    }
  };
  elements(mesh.tetrahedra, mesh.tetrahedra.cols() == 10 ? "C3D10" : "C3D4", "BODY", 0);
  if (mesh.tetrahedra.rows() == 0) elements(mesh.triangles, "S3", "SURFACE", 0);
  return out;
}

}  // namespace palpate::io
