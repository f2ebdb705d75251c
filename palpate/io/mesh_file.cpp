// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/mesh_file.hpp"

#include <algorithm>
#include <array>

#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/mesh_formats.hpp"

namespace palpate::io {

std::span<const MeshFormat> mesh_formats() {
  static const std::array formats = {
      MeshFormat{"vtu", {".vtu"}, true, true, "VTK XML (ParaView), binary", read_vtu, write_vtu},
      MeshFormat{"vtu_ascii", {".vtu"}, true, true, "VTK XML (ParaView), text", read_vtu, write_vtu_ascii},
      MeshFormat{"vtk", {".vtk"}, true, true, "legacy VTK, text", read_vtk, write_vtk},
      MeshFormat{"vtk_binary", {".vtk"}, true, true, "legacy VTK, binary", read_vtk, write_vtk_binary},
      MeshFormat{"msh41", {".msh"}, true, true, "Gmsh 4.1, text", read_gmsh, write_gmsh41},
      MeshFormat{"msh41_binary", {".msh"}, true, true, "Gmsh 4.1, binary", read_gmsh, write_gmsh41_binary},
      MeshFormat{"msh22", {".msh"}, true, true, "Gmsh 2.2, text", read_gmsh, write_gmsh22},
      MeshFormat{"msh22_binary", {".msh"}, true, true, "Gmsh 2.2, binary", read_gmsh, write_gmsh22_binary},
      MeshFormat{"ply", {".ply"}, true, false, "PLY, binary", read_ply_mesh, write_ply_mesh},
      MeshFormat{"ply_ascii", {".ply"}, true, false, "PLY, text", read_ply_mesh, write_ply_mesh_ascii},
      MeshFormat{"stl", {".stl"}, true, false, "STL, binary (single precision)", read_stl, write_stl},
      MeshFormat{"stl_ascii", {".stl"}, true, false, "STL, text", read_stl, write_stl_ascii},
      MeshFormat{"obj", {".obj"}, true, false, "Wavefront OBJ", read_obj, write_obj},
      MeshFormat{"inp", {".inp"}, true, true, "CalculiX / Abaqus input deck (mesh and node sets)", nullptr, write_calculix},
  };
  return formats;
}

const MeshFormat& mesh_format_of(const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  std::string known;
  for (const MeshFormat& format : mesh_formats()) {
    for (const std::string& one : format.extensions) {
      if (one == extension) return format;
      if (known.find(one) == std::string::npos) known += (known.empty() ? "" : ", ") + one + (format.read == nullptr ? " (only written)" : "");
    }
  }
  throw Error("no mesh format has the ending '" + extension + "'; known are " + known, path.string());
}

const MeshFormat& mesh_format_named(const std::string& name) {
  std::string known;
  for (const MeshFormat& format : mesh_formats()) {
    if (format.name == name) return format;
    known += (known.empty() ? "" : ", ") + format.name;
  }
  throw Error("there is no mesh format '" + name + "'; known are " + known);
}

MeshData parse_mesh(std::string_view bytes, const std::filesystem::path& path) {
  const MeshFormat& format = mesh_format_of(path);
  const std::string name = path.string();
  if (format.read == nullptr) throw Error("this format is only written, not read; convert it to .vtu, .vtk or .msh", name);
  if (bytes.empty()) throw Error("the file is empty", name);
  MeshData mesh = format.read(bytes, name);
  if (mesh.points_m.rows() == 0) throw Error("holds no point", name);
  if (mesh.triangles.rows() == 0 && mesh.tetrahedra.rows() == 0) throw Error("holds neither triangles nor tetrahedra", name);
  for (Eigen::Index i = 0; i < mesh.points_m.rows(); ++i) {
    if (!mesh.points_m.row(i).allFinite()) throw Error("point " + std::to_string(i) + " is not finite", name);
  }
  const auto check = [&](const auto& cells, const char* what) {
    for (Eigen::Index i = 0; i < cells.rows(); ++i) {
      if (cells.row(i).minCoeff() < 0 || cells.row(i).maxCoeff() >= mesh.points_m.rows()) {
        throw Error(std::string(what) + " " + std::to_string(i) + " refers to a point that is not there (the file has " +
                        std::to_string(mesh.points_m.rows()) + "); the file is damaged",
                    name);
      }
    }
  };
  check(mesh.triangles, "triangle");
  check(mesh.tetrahedra, "tetrahedron");
  return mesh;
}

MeshData read_mesh(const std::filesystem::path& path) {
  mesh_format_of(path);  // an unknown ending is the better message than a missing file
  return parse_mesh(read_file(path), path);
}

TetMesh tet_mesh_of(MeshData mesh, const std::string& name) {
  if (mesh.tetrahedra.rows() == 0) {
    throw Error("holds no tetrahedra but " + std::to_string(mesh.triangles.rows()) +
                    " triangles; give it as a surface, or make a volume with `palpate model`",
                name);
  }
  return {std::move(mesh.points_m), std::move(mesh.tetrahedra)};
}

TriMesh tri_mesh_of(MeshData mesh, const std::string& name) {
  if (mesh.triangles.rows() == 0) {
    throw Error("holds no triangles but " + std::to_string(mesh.tetrahedra.rows()) + " tetrahedra; give it as a volume",
                name);
  }
  return {std::move(mesh.points_m), std::move(mesh.triangles)};
}

TetMesh read_tet_mesh(const std::filesystem::path& path) { return tet_mesh_of(read_mesh(path), path.string()); }
TriMesh read_tri_mesh(const std::filesystem::path& path) { return tri_mesh_of(read_mesh(path), path.string()); }

void write_mesh(const std::filesystem::path& path, const MeshData& mesh) {
  const MeshFormat& format = mesh_format_of(path);
  if (mesh.tetrahedra.rows() > 0 && mesh.triangles.rows() == 0 && !format.tetrahedra) {
    throw Error("the format " + format.name + " holds surfaces only; choose .vtu, .vtk or .msh for a volume", path.string());
  }
  write_file(path, format.write(mesh));
}

void write_mesh(const std::filesystem::path& path, const TetMesh& mesh) {
  MeshData data;
  data.points_m = mesh.nodes_m;
  data.tetrahedra = mesh.tetrahedra;
  write_mesh(path, data);
}

void write_mesh(const std::filesystem::path& path, const TriMesh& mesh) {
  MeshData data;
  data.points_m = mesh.vertices_m;
  data.triangles = mesh.triangles;
  write_mesh(path, data);
}

}  // namespace palpate::io
