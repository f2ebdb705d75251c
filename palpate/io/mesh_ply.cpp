// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "palpate/core/error.hpp"
#include "palpate/io/bytes.hpp"
#include "palpate/io/mesh_builder.hpp"
#include "palpate/io/mesh_formats.hpp"
#include "palpate/io/ply.hpp"

namespace palpate::io {
namespace {

std::string mesh_header(const MeshData& mesh, const char* format) {
  return fmt::format(
      "ply\nformat {} 1.0\ncomment metres\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      format, mesh.points_m.rows(), mesh.triangles.rows());
}

}  // namespace

MeshData read_ply_mesh(std::string_view bytes, const std::string& name) {
  MeshBuilder builder;
  for (const PlyElement& element : parse_ply(bytes, name)) {
    if (element.name == "vertex") {
      const auto x = element.column("x"), y = element.column("y"), z = element.column("z");
      if (!x || !y || !z) throw Error("the vertices have no x, y and z", name);
      builder.reserve_points(element.rows);
      for (Eigen::Index i = 0; i < element.values.rows(); ++i) {
        builder.point(element.values(i, *x), element.values(i, *y), element.values(i, *z));
      }
    } else if (element.name == "face") {
      for (std::size_t list = 0; list < element.lists.size(); ++list) {
        if (element.lists[list] != "vertex_indices" && element.lists[list] != "vertex_index") continue;
        for (const std::vector<Index>& corners : element.list_values[list]) builder.polygon(corners);
      }
    }
  }
  return builder.build(name);
}

std::string write_ply_mesh(const MeshData& mesh) {
  std::string out = mesh_header(mesh, "binary_little_endian");
  for (Eigen::Index i = 0; i < mesh.points_m.rows(); ++i) {
    for (int axis = 0; axis < 3; ++axis) store(out, mesh.points_m(i, axis));
  }
  for (Eigen::Index i = 0; i < mesh.triangles.rows(); ++i) {
    store(out, std::uint8_t{3});
    for (int k = 0; k < 3; ++k) store(out, mesh.triangles(i, k));
  }
  return out;
}

std::string write_ply_mesh_ascii(const MeshData& mesh) {
  std::string out = mesh_header(mesh, "ascii");
  for (Eigen::Index i = 0; i < mesh.points_m.rows(); ++i) {
    fmt::format_to(std::back_inserter(out), "{} {} {}\n", mesh.points_m(i, 0), mesh.points_m(i, 1), mesh.points_m(i, 2));
  }
  for (Eigen::Index i = 0; i < mesh.triangles.rows(); ++i) {
    fmt::format_to(std::back_inserter(out), "3 {} {} {}\n", mesh.triangles(i, 0), mesh.triangles(i, 1),
                   mesh.triangles(i, 2));
  }
  return out;
}

}  // namespace palpate::io
