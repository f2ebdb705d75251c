// SPDX-License-Identifier: Apache-2.0
// Writing of Gmsh's MSH 2.2 and 4.1, text and binary. Tags are row + 1; the surface is entity 1, the volume entity 2.
#include <fmt/format.h>

#include "palpate/io/bytes.hpp"
#include "palpate/io/mesh_formats.hpp"

namespace palpate::io {
namespace {

constexpr int triangle_type = 2;
constexpr int surface_entity = 1, volume_entity = 2;

int tet_type(const MeshData& mesh) { return mesh.tetrahedra.cols() == 10 ? 11 : 4; }
/// Column of ours that stands at place k of Gmsh's order (edges 01 12 02 03 23 13).
Eigen::Index gmsh_column(Eigen::Index k) { return k == 8 ? 9 : k == 9 ? 8 : k; }

class GmshWriter {
 public:
  GmshWriter(const MeshData& mesh, bool version4, bool binary) : mesh_(mesh), version4_(version4), binary_(binary) {}

  std::string write() {
    text("$MeshFormat\n{} {} 8\n", version4_ ? "4.1" : "2.2", binary_ ? 1 : 0);
    if (binary_) {
      store(out_, std::int32_t{1});
      out_ += '\n';
    }
    out_ += "$EndMeshFormat\n$Nodes\n";
    version4_ ? nodes4() : nodes2();
    out_ += "$EndNodes\n$Elements\n";
    version4_ ? elements4() : elements2();
    out_ += "$EndElements\n";
    for (const auto& [name, values] : mesh_.point_fields) field("NodeData", name, values, 0);
    // Elements are numbered through: triangles first.
    const Eigen::Index first = mesh_.tetrahedra.rows() > 0 ? mesh_.triangles.rows() : 0;
    for (const auto& [name, values] : mesh_.cell_fields) field("ElementData", name, values, first);
    return std::move(out_);
  }

 private:
  template <typename... Args>
  void text(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(out_), format, std::forward<Args>(args)...);
  }
  void int32(std::int64_t value) { binary_ ? store(out_, static_cast<std::int32_t>(value)) : text("{} ", value); }
  void size(std::int64_t value) { binary_ ? store(out_, value) : text("{} ", value); }
  void real(double value) { binary_ ? store(out_, value) : text("{} ", value); }
  void end_row() {
    if (binary_) return;
    out_.back() = '\n';
  }
  /// A tag: 4 bytes in version 2, 8 in version 4.
  void tag(std::int64_t value) { version4_ ? size(value) : int32(value); }

  void nodes2() {
    text("{}\n", mesh_.points_m.rows());
    for (Eigen::Index i = 0; i < mesh_.points_m.rows(); ++i) {
      tag(i + 1);
      for (int axis = 0; axis < 3; ++axis) real(mesh_.points_m(i, axis));
      end_row();
    }
    if (binary_) out_ += '\n';
  }

  void nodes4() {
    const std::int64_t nodes = mesh_.points_m.rows();
    for (const std::int64_t value : {std::int64_t{1}, nodes, std::int64_t{1}, nodes}) size(value);
    end_row();
    const bool volume = mesh_.tetrahedra.rows() > 0;
    int32(volume ? 3 : 2), int32(volume ? volume_entity : surface_entity), int32(0), size(nodes);
    end_row();
    for (std::int64_t i = 0; i < nodes; ++i) {
      size(i + 1);
      end_row();
    }
    for (Eigen::Index i = 0; i < nodes; ++i) {
      for (int axis = 0; axis < 3; ++axis) real(mesh_.points_m(i, axis));
      end_row();
    }
    if (binary_) out_ += '\n';
  }

  void triangle_nodes(Eigen::Index i) {
    for (Eigen::Index k = 0; k < 3; ++k) tag(mesh_.triangles(i, k) + 1);
    end_row();
  }
  void tet_nodes(Eigen::Index i) {
    for (Eigen::Index k = 0; k < mesh_.tetrahedra.cols(); ++k) tag(mesh_.tetrahedra(i, gmsh_column(k)) + 1);
    end_row();
  }

  void elements2() {
    const Eigen::Index triangles = mesh_.triangles.rows(), tets = mesh_.tetrahedra.rows();
    text("{}\n", triangles + tets);
    const auto block = [&](Eigen::Index count, int type, int entity, Eigen::Index offset, auto nodes) {
      if (binary_ && count > 0) int32(type), int32(count), int32(2);
      for (Eigen::Index i = 0; i < count; ++i) {
        tag(offset + i + 1);
        if (!binary_) int32(type), int32(2);
        int32(entity), int32(entity);
        nodes(i);
      }
    };
    block(triangles, triangle_type, surface_entity, 0, [&](Eigen::Index i) { triangle_nodes(i); });
    block(tets, tet_type(mesh_), volume_entity, triangles, [&](Eigen::Index i) { tet_nodes(i); });
    if (binary_) out_ += '\n';
  }

  void elements4() {
    const std::int64_t triangles = mesh_.triangles.rows(), tets = mesh_.tetrahedra.rows();
    const std::int64_t blocks = (triangles > 0 ? 1 : 0) + (tets > 0 ? 1 : 0);
    for (const std::int64_t value : {blocks, triangles + tets, std::int64_t{1}, triangles + tets}) size(value);
    end_row();
    const auto block = [&](std::int64_t count, int dimension, int entity, int type, std::int64_t offset, auto nodes) {
      if (count == 0) return;
      int32(dimension), int32(entity), int32(type), size(count);
      end_row();
      for (std::int64_t i = 0; i < count; ++i) {
        size(offset + i + 1);
        nodes(i);
      }
    };
    block(triangles, 2, surface_entity, triangle_type, 0, [&](Eigen::Index i) { triangle_nodes(i); });
    block(tets, 3, volume_entity, tet_type(mesh_), triangles, [&](Eigen::Index i) { tet_nodes(i); });
    if (binary_) out_ += '\n';
  }

  void field(const char* section, const std::string& name, const MatrixX& values, std::int64_t offset) {
    std::string safe = name;
    for (char& letter : safe) {
      if (letter == '"' || letter == '\n' || letter == '\r') letter = '_';
    }
    text("${}\n1\n\"{}\"\n1\n0\n3\n0\n{}\n{}\n", section, safe, values.cols(), values.rows());
    for (Eigen::Index i = 0; i < values.rows(); ++i) {
      int32(offset + i + 1);
      for (Eigen::Index k = 0; k < values.cols(); ++k) real(values(i, k));
      end_row();
    }
    text("{}$End{}\n", binary_ ? "\n" : "", section);
  }

  const MeshData& mesh_;
  bool version4_, binary_;
  std::string out_;
};

}  // namespace

std::string write_gmsh22(const MeshData& mesh) { return GmshWriter(mesh, false, false).write(); }
std::string write_gmsh22_binary(const MeshData& mesh) { return GmshWriter(mesh, false, true).write(); }
std::string write_gmsh41(const MeshData& mesh) { return GmshWriter(mesh, true, false).write(); }
std::string write_gmsh41_binary(const MeshData& mesh) { return GmshWriter(mesh, true, true).write(); }

}  // namespace palpate::io
