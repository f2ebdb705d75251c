// SPDX-License-Identifier: Apache-2.0
// Mesh files behind one table: a format is one file in this room and one line in mesh_file.cpp.
#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::io {

/// What a mesh file holds. Tetrahedra have 4 or 10 columns in the node order of TetMesh, whatever the file's own order is;
/// triangles of second order give their corners. Nothing is reordered, merged or turned round: row i is the file's point i
/// (STL alone has no shared points; equal ones are merged).
struct MeshData {
  Points points_m = Points(0, 3);
  Triangles triangles = Triangles(0, 3);
  Tetrahedra tetrahedra = Tetrahedra(0, 4);
  std::map<std::string, MatrixX>
      point_fields;                            ///< written by VTU, VTK and MSH: rows = points, 1 or 3 columns; not read back
  std::map<std::string, MatrixX> cell_fields;  ///< rows = tetrahedra, or triangles where there are no tetrahedra
};

struct MeshFormat {
  std::string name;                     ///< "vtu"; a variant for writing is named "vtu_ascii"
  std::vector<std::string> extensions;  ///< lower case with the dot
  bool triangles = false;
  bool tetrahedra = false;
  std::string about;
  MeshData (*read)(std::string_view bytes, const std::string& name) = nullptr;  ///< nullptr: written only
  std::string (*write)(const MeshData& mesh) = nullptr;
};

/// All formats. For reading and for writing by extension the first that has the extension counts; readers tell variants
/// (ASCII, binary, version) apart by the content.
std::span<const MeshFormat> mesh_formats();
/// Throws Error when no format has that extension (the message lists those that are known).
const MeshFormat& mesh_format_of(const std::filesystem::path& path);
const MeshFormat& mesh_format_named(const std::string& name);

/// Throws Error naming file and line on bytes that are cut off, damaged or not finite, on indices out of range and on a
/// file without any cell.
MeshData read_mesh(const std::filesystem::path& path);
MeshData parse_mesh(std::string_view bytes, const std::filesystem::path& path);
TetMesh read_tet_mesh(const std::filesystem::path& path);
TriMesh read_tri_mesh(const std::filesystem::path& path);

void write_mesh(const std::filesystem::path& path, const MeshData& mesh);
void write_mesh(const std::filesystem::path& path, const TetMesh& mesh);
void write_mesh(const std::filesystem::path& path, const TriMesh& mesh);

/// The surface or the volume alone, with a word where the file has none.
TetMesh tet_mesh_of(MeshData mesh, const std::string& name);
TriMesh tri_mesh_of(MeshData mesh, const std::string& name);

}  // namespace palpate::io
