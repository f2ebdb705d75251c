// SPDX-License-Identifier: Apache-2.0
// Legacy VTK (file versions 1.0 to 5.1), text and binary (big endian): polygonal data and unstructured grids. Reading stops
// at the point and cell data, which are not needed.
#include <fmt/format.h>

#include <algorithm>

#include "palpate/io/bytes.hpp"
#include "palpate/io/mesh_formats.hpp"
#include "palpate/io/scanner.hpp"
#include "palpate/io/vtk_cells.hpp"

namespace palpate::io {
namespace {

std::string upper(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::toupper(letter)); });
  return result;
}

class VtkReader {
 public:
  explicit VtkReader(Scanner& file) : file_(file) {}

  MeshData read() {
    const std::string_view first = file_.line();
    if (first.substr(0, 14) != "# vtk DataFile") {
      file_.seek(0);
      file_.fail("does not start with '# vtk DataFile'; it is not a legacy VTK file");
    }
    file_.line();  // title
    const std::string kind = upper(file_.word("ASCII or BINARY"));
    if (kind != "ASCII" && kind != "BINARY") file_.fail("expected ASCII or BINARY");
    binary_ = kind == "BINARY";
    file_.expect("DATASET");
    const std::string dataset = upper(file_.word("the kind of data set"));
    if (dataset != "UNSTRUCTURED_GRID" && dataset != "POLYDATA") {
      file_.fail("data set " + dataset.substr(0, 30) + " is not read: only UNSTRUCTURED_GRID and POLYDATA are");
    }
    while (!file_.at_end()) {
      const std::string key = upper(file_.word("a section"));
      if (key == "POINTS") {
        read_points();
      } else if (key == "CELLS" || key == "POLYGONS") {
        read_cells(key == "POLYGONS" ? &polygons_ : &cells_);
      } else if (key == "CELL_TYPES") {
        const std::size_t cells = file_.count("the number of cell types", binary_ ? 4 : 2);
        file_.line();
        types_.resize(cells);
        for (std::int64_t& type : types_) type = integer("a cell type", 4);
      } else if (key == "VERTICES" || key == "LINES" || key == "TRIANGLE_STRIPS") {
        if (key == "TRIANGLE_STRIPS") file_.fail("triangle strips are not read; save plain triangles");
        VtkCells ignored;
        read_cells(&ignored);
      } else if (key == "POINT_DATA" || key == "CELL_DATA") {
        break;
      } else if (key == "METADATA") {
        while (file_.remaining() > 0 && !trimmed(file_.line()).empty()) {
        }
      } else if (key == "FIELD") {
        skip_field();
      } else {
        file_.fail("unknown section '" + key.substr(0, 30) + "'");
      }
    }
    MeshBuilder builder;
    for (std::size_t i = 0; i < points_.size() / 3; ++i)
      builder.point(points_[3 * i], points_[3 * i + 1], points_[3 * i + 2]);
    if (dataset == "POLYDATA") {
      types_.assign(polygons_.count(), 7);
      add_vtk_cells(polygons_, types_, builder, file_);
    } else {
      add_vtk_cells(cells_, types_, builder, file_);
    }
    return builder.build(file_.name());
  }

 private:
  std::int64_t integer(const char* what, std::size_t size) {
    if (!binary_) return file_.whole(what);
    const char* raw = file_.take(size, what).data();
    return size == 8 ? load<std::int64_t>(raw, std::endian::big) : load<std::int32_t>(raw, std::endian::big);
  }

  void read_points() {
    const std::size_t points = file_.count("the number of points", binary_ ? 12 : 6);
    const std::string type(file_.word("the type of the points"));
    if (type != "double" && type != "float")
      file_.fail("points of type '" + type.substr(0, 20) + "' are not read: only float and double are");
    file_.line();
    file_.check_count(3 * points, "coordinates", binary_ ? (type == "double" ? 8 : 4) : 2);
    points_.resize(3 * points);
    for (double& x : points_) {
      if (!binary_) {
        x = file_.number("a coordinate");
      } else if (type == "double") {
        x = load<double>(file_.take(8, "the points").data(), std::endian::big);
      } else {
        x = static_cast<double>(load<float>(file_.take(4, "the points").data(), std::endian::big));
      }
    }
  }

  void read_cells(VtkCells* cells) {
    const std::size_t first = file_.count("the number of cells", 2);
    const std::size_t second = file_.count("the size of the cell list", 2);
    file_.line();
    const std::size_t before = file_.position();
    if (upper(file_.peek_word()) == "OFFSETS") {  // version 5.1
      file_.word("OFFSETS");
      cells->offsets = read_array(first);
      file_.expect("CONNECTIVITY");
      cells->connectivity = read_array(second);
      return;
    }
    file_.seek(before);  // peeking eats blanks, and in a binary file they may be data
    file_.check_count(second, "the size of the cell list", binary_ ? 4 : 2);
    cells->offsets = {0};
    std::size_t used = 0;
    for (std::size_t cell = 0; cell < first; ++cell) {
      const std::int64_t nodes = integer("a cell's number of nodes", 4);
      used += 1 + static_cast<std::size_t>(std::max<std::int64_t>(nodes, 0));
      if (nodes < 0 || used > second) file_.fail("cell " + std::to_string(cell) + " has a wrong number of nodes");
      for (std::int64_t k = 0; k < nodes; ++k) cells->connectivity.push_back(integer("a node of a cell", 4));
      cells->offsets.push_back(static_cast<std::int64_t>(cells->connectivity.size()));
    }
  }

  std::vector<std::int64_t> read_array(std::size_t count) {
    const std::string type(file_.word("vtktypeint64 or vtktypeint32"));
    if (type != "vtktypeint64" && type != "vtktypeint32")
      file_.fail("arrays of type '" + type.substr(0, 20) + "' are not read");
    file_.line();
    const std::size_t size = type == "vtktypeint64" ? 8 : 4;
    file_.check_count(count, "an array", binary_ ? size : 2);
    std::vector<std::int64_t> result(count);
    for (std::int64_t& value : result) value = integer("an offset", size);
    return result;
  }

  /// Arrays such as ParaView's TimeValue stand before the points. Text only; in binary files none was seen.
  void skip_field() {
    file_.word("the field's name");
    const std::int64_t arrays = file_.whole("the number of arrays", 0, 1000);
    for (std::int64_t i = 0; i < arrays; ++i) {
      file_.word("the array's name");
      const std::int64_t components = file_.whole("the number of components", 0, 1000);
      const std::size_t tuples = file_.count("the number of tuples", 1);
      const std::string type(file_.word("the array's type"));
      file_.line();
      const auto values = static_cast<std::size_t>(components) * tuples;
      if (binary_) {
        const std::size_t size = type == "double" || type == "vtktypeint64"  ? 8
                                 : type == "char" || type == "unsigned_char" ? 1
                                                                             : 4;
        file_.take(values * size, "a field");
      } else {
        for (std::size_t k = 0; k < values; ++k) file_.word("a value of a field");
      }
    }
  }

  Scanner& file_;
  bool binary_ = false;
  std::vector<double> points_;
  VtkCells cells_, polygons_;
  std::vector<std::int64_t> types_;
};

class VtkWriter {
 public:
  VtkWriter(const MeshData& mesh, bool binary) : mesh_(mesh), binary_(binary) {}

  std::string write() {
    text("# vtk DataFile Version 3.0\npalpate, metres\n{}\nDATASET UNSTRUCTURED_GRID\nPOINTS {} double\n",
         binary_ ? "BINARY" : "ASCII", mesh_.points_m.rows());
    rows(mesh_.points_m);
    const Eigen::Index triangles = mesh_.triangles.rows(), tets = mesh_.tetrahedra.rows(), nodes = mesh_.tetrahedra.cols();
    text("CELLS {} {}\n", triangles + tets, 4 * triangles + (nodes + 1) * tets);
    // Tetrahedra first: cell fields speak of them.
    cells(mesh_.tetrahedra);
    cells(mesh_.triangles);
    if (binary_) out_ += '\n';
    text("CELL_TYPES {}\n", triangles + tets);
    for (Eigen::Index i = 0; i < tets; ++i) integer(nodes == 10 ? 24 : 10), end_row();
    for (Eigen::Index i = 0; i < triangles; ++i) integer(5), end_row();
    if (binary_) out_ += '\n';
    fields("POINT_DATA", mesh_.point_fields, mesh_.points_m.rows());
    fields("CELL_DATA", mesh_.cell_fields, triangles + tets);
    return std::move(out_);
  }

 private:
  template <typename... Args>
  void text(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(out_), format, std::forward<Args>(args)...);
  }
  void integer(Eigen::Index value) {
    binary_ ? store(out_, static_cast<std::int32_t>(value), std::endian::big) : text("{} ", value);
  }
  void real(double value) { binary_ ? store(out_, value, std::endian::big) : text("{} ", value); }
  void end_row() {
    if (!binary_) out_.back() = '\n';
  }
  template <typename Matrix>
  void rows(const Matrix& values) {
    for (Eigen::Index i = 0; i < values.rows(); ++i) {
      for (Eigen::Index k = 0; k < values.cols(); ++k) real(values(i, k));
      end_row();
    }
    if (binary_) out_ += '\n';
  }
  template <typename Matrix>
  void cells(const Matrix& nodes) {
    for (Eigen::Index i = 0; i < nodes.rows(); ++i) {
      integer(nodes.cols());
      for (Eigen::Index k = 0; k < nodes.cols(); ++k) integer(nodes(i, k));
      end_row();
    }
  }
  void fields(const char* section, const std::map<std::string, MatrixX>& all, Eigen::Index count) {
    if (all.empty()) return;
    text("{} {}\n", section, count);
    for (const auto& [name, values] : all) {
      std::string safe = name;
      std::replace_if(
          safe.begin(), safe.end(), [](unsigned char letter) { return letter <= ' '; }, '_');
      if (values.cols() == 3) {
        text("VECTORS {} double\n", safe);
      } else {
        text("SCALARS {} double {}\nLOOKUP_TABLE default\n", safe, values.cols());
      }
      MatrixX padded = MatrixX::Zero(count, values.cols());  // triangles beside tetrahedra carry zeros
      padded.topRows(std::min(count, values.rows())) = values.topRows(std::min(count, values.rows()));
      rows(padded);
    }
  }

  const MeshData& mesh_;
  bool binary_;
  std::string out_;
};

}  // namespace

MeshData read_vtk(std::string_view bytes, const std::string& name) {
  Scanner file(bytes, name);
  return VtkReader(file).read();
}

std::string write_vtk(const MeshData& mesh) { return VtkWriter(mesh, false).write(); }
std::string write_vtk_binary(const MeshData& mesh) { return VtkWriter(mesh, true).write(); }

}  // namespace palpate::io
