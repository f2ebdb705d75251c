// SPDX-License-Identifier: Apache-2.0
// The readers and writers behind the table in mesh_file.cpp, one pair a file.
#pragma once

#include "palpate/io/mesh_file.hpp"

namespace palpate::io {

MeshData read_obj(std::string_view bytes, const std::string& name);
std::string write_obj(const MeshData& mesh);
MeshData read_stl(std::string_view bytes, const std::string& name);
std::string write_stl(const MeshData& mesh);
std::string write_stl_ascii(const MeshData& mesh);
MeshData read_ply_mesh(std::string_view bytes, const std::string& name);
std::string write_ply_mesh(const MeshData& mesh);
std::string write_ply_mesh_ascii(const MeshData& mesh);
MeshData read_vtk(std::string_view bytes, const std::string& name);
std::string write_vtk(const MeshData& mesh);
std::string write_vtk_binary(const MeshData& mesh);
MeshData read_vtu(std::string_view bytes, const std::string& name);
std::string write_vtu(const MeshData& mesh);
std::string write_vtu_ascii(const MeshData& mesh);
MeshData read_gmsh(std::string_view bytes, const std::string& name);
std::string write_gmsh22(const MeshData& mesh);
std::string write_gmsh22_binary(const MeshData& mesh);
std::string write_gmsh41(const MeshData& mesh);
std::string write_gmsh41_binary(const MeshData& mesh);
std::string write_calculix(const MeshData& mesh);

}  // namespace palpate::io
