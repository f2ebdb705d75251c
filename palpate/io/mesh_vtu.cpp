// SPDX-License-Identifier: Apache-2.0
// VTK's XML format for unstructured grids: text, inline base64 and appended (raw or base64) arrays, with or without zlib.
#include <fmt/format.h>
#include <zlib.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/io/base64.hpp"
#include "palpate/io/bytes.hpp"
#include "palpate/io/mesh_formats.hpp"
#include "palpate/io/vtk_cells.hpp"
#include "palpate/io/xml.hpp"

namespace palpate::io {
namespace {

class VtuReader {
 public:
  VtuReader(std::string_view bytes, const std::string& name) : name_(name) {
    // Appended raw data are not XML: they are cut out before the rest is parsed.
    const std::size_t appended = bytes.find("<AppendedData");
    std::string head(bytes.substr(0, appended));
    if (appended != std::string_view::npos) {
      const std::size_t start = bytes.find('_', bytes.find('>', appended));
      const std::size_t end = bytes.rfind("</AppendedData>");
      if (start == std::string_view::npos || end == std::string_view::npos || end < start) {
        throw Error("the appended data have no beginning or no end; the file is cut off", name);
      }
      appended_raw_ = bytes.substr(appended, start - appended).find("\"raw\"") != std::string_view::npos;
      appended_ = bytes.substr(start + 1, end - start - 1);
      head += "</VTKFile>";
    }
    root_ = parse_xml(head, name);
  }

  MeshData read() {
    if (root_.name != "VTKFile" || root_.attribute("type") != "UnstructuredGrid") {
      throw Error("is not a VTK XML file of type UnstructuredGrid", at(root_));
    }
    order_ = root_.attribute("byte_order", "LittleEndian") == "BigEndian" ? std::endian::big : std::endian::little;
    header_size_ = root_.attribute("header_type", "UInt32") == "UInt64" ? 8 : 4;
    const std::string compressor = root_.attribute("compressor");
    compressed_ = !compressor.empty();
    if (compressed_ && compressor != "vtkZLibDataCompressor")
      throw Error("compressor " + compressor + " is not read; save with zlib or without", at(root_));
    const XmlElement& grid = need(root_, "UnstructuredGrid");
    MeshBuilder builder;
    for (const XmlElement& piece : grid.children) {
      if (piece.name == "Piece") read_piece(piece, builder);
    }
    return builder.build(name_);
  }

 private:
  std::string at(const XmlElement& element) const { return name_ + ":" + std::to_string(element.line); }

  const XmlElement& need(const XmlElement& parent, const char* child) const {
    const XmlElement* found = parent.child(child);
    if (found == nullptr) throw Error("element " + parent.name + " has no " + child, at(parent));
    return *found;
  }

  const XmlElement& array_named(const XmlElement& parent, const std::string& wanted) const {
    for (const XmlElement& one : parent.children) {
      if (one.name == "DataArray" && one.attribute("Name") == wanted) return one;
    }
    throw Error(parent.name + " has no DataArray '" + wanted + "'", at(parent));
  }

  void read_piece(const XmlElement& piece, MeshBuilder& builder) {
    const XmlElement* points = need(piece, "Points").child("DataArray");
    if (points == nullptr) throw Error("Points has no DataArray", at(piece));
    const std::vector<double> x = values(*points);
    if (x.size() % 3 != 0) throw Error("the number of coordinates is not a multiple of three", at(*points));
    const auto first = static_cast<std::int64_t>(builder.points());
    for (std::size_t i = 0; i < x.size(); i += 3) builder.point(x[i], x[i + 1], x[i + 2]);

    const XmlElement& cells = need(piece, "Cells");
    VtkCells list;
    list.offsets = {0};
    for (const std::int64_t end : integers(array_named(cells, "offsets"))) list.offsets.push_back(end);
    list.connectivity = integers(array_named(cells, "connectivity"));
    for (std::int64_t& node : list.connectivity) node += first;
    const auto announced = [&](const char* key, std::size_t found) {
      const std::string text = piece.attribute(key);
      const auto count = parse_whole(text);
      if (!text.empty() && (!count || *count != static_cast<std::int64_t>(found))) {
        throw Error(std::string(key) + " says " + text.substr(0, 20) + ", " + std::to_string(found) +
                        " were found; the file is cut off or damaged",
                    at(piece));
      }
    };
    announced("NumberOfPoints", x.size() / 3);
    announced("NumberOfCells", list.count());
    add_vtk_cells(list, integers(array_named(cells, "types")), builder, Scanner({}, name_));
  }

  std::vector<std::int64_t> integers(const XmlElement& array) const {
    std::vector<std::int64_t> result;
    for (const double value : values(array)) {
      if (!(std::abs(value) < 9e15)) throw Error("holds something that is not a whole number", at(array));
      result.push_back(static_cast<std::int64_t>(value));
    }
    return result;
  }

  /// The array's numbers, whatever its type: indices below 2^53 are exact in double.
  std::vector<double> values(const XmlElement& array) const {
    const std::string format = array.attribute("format", "ascii");
    if (format == "ascii") {
      Scanner words(array.text, name_);
      std::vector<double> result;
      while (!words.at_end()) {
        const auto value = parse_number(words.word("a number"));
        if (!value || !std::isfinite(*value)) throw Error("holds something that is not a finite number", at(array));
        result.push_back(*value);
      }
      return result;
    }
    return converted(array.attribute("type"), payload(array, format), array);
  }

  std::string payload(const XmlElement& array, const std::string& format) const {
    std::string bytes;
    if (format == "binary") {
      bytes = decoded(array.text, array);
    } else if (format == "appended") {
      const auto offset = parse_whole(array.attribute("offset"));
      if (!offset || *offset < 0 || static_cast<std::size_t>(*offset) >= appended_.size()) {
        throw Error("the array's offset lies outside the appended data; the file is cut off", at(array));
      }
      const std::string_view rest = appended_.substr(static_cast<std::size_t>(*offset));
      bytes = appended_raw_ ? std::string(rest) : decoded(rest, array);
    } else {
      throw Error("unknown format '" + format.substr(0, 20) + "' of a DataArray", at(array));
    }
    const std::uint64_t first = header(bytes, 0, array);
    if (compressed_) return inflated(bytes, first, array);
    if (first > bytes.size() - header_size_) throw Error("the array is cut off", at(array));
    return bytes.substr(header_size_, first);
  }

  std::string decoded(std::string_view text, const XmlElement& array) const {
    auto bytes = base64_decoded(text);
    if (!bytes) throw Error("holds something that is not base64", at(array));
    return std::move(*bytes);
  }

  std::uint64_t header(const std::string& bytes, std::size_t place, const XmlElement& array) const {
    if (bytes.size() < (place + 1) * header_size_) throw Error("the array is cut off", at(array));
    const char* raw = bytes.data() + place * header_size_;
    return header_size_ == 8 ? load<std::uint64_t>(raw, order_) : load<std::uint32_t>(raw, order_);
  }

  /// Header: number of blocks, size of a block, size of the last one if partial, compressed size of each.
  std::string inflated(const std::string& bytes, std::uint64_t blocks, const XmlElement& array) const {
    if (blocks == 0) return {};
    if (blocks > bytes.size() / header_size_) throw Error("the array is cut off", at(array));
    const std::uint64_t block_size = header(bytes, 1, array), last = header(bytes, 2, array);
    std::uint64_t place = (3 + blocks) * header_size_;
    std::string result;
    for (std::uint64_t block = 0; block < blocks; ++block) {
      const std::uint64_t packed = header(bytes, 3 + block, array);
      const std::uint64_t size = block + 1 == blocks && last > 0 ? last : block_size;
      // zlib packs at most about 1030 to 1: what claims more is damaged, and no memory is asked for.
      if (place > bytes.size() || packed > bytes.size() - place || size > 1100 * packed + 64)
        throw Error("the array is cut off or damaged", at(array));
      const std::size_t before = result.size();
      result.resize(before + size);
      uLongf written = size;
      const int code = uncompress(reinterpret_cast<Bytef*>(result.data() + before), &written,
                                  reinterpret_cast<const Bytef*>(bytes.data() + place), packed);
      if (code != Z_OK || written != size) throw Error("compressed data are damaged", at(array));
      place += packed;
    }
    return result;
  }

  template <typename T>
  std::vector<double> as(const std::string& bytes) const {
    std::vector<double> result(bytes.size() / sizeof(T));
    for (std::size_t i = 0; i < result.size(); ++i)
      result[i] = static_cast<double>(load<T>(bytes.data() + i * sizeof(T), order_));
    return result;
  }
  std::vector<double> converted(const std::string& type, const std::string& bytes, const XmlElement& array) const {
    if (type == "Float64") return as<double>(bytes);
    if (type == "Float32") return as<float>(bytes);
    if (type == "Int64") return as<std::int64_t>(bytes);
    if (type == "UInt64") return as<std::uint64_t>(bytes);
    if (type == "Int32") return as<std::int32_t>(bytes);
    if (type == "UInt32") return as<std::uint32_t>(bytes);
    if (type == "Int16") return as<std::int16_t>(bytes);
    if (type == "UInt16") return as<std::uint16_t>(bytes);
    if (type == "Int8") return as<std::int8_t>(bytes);
    if (type == "UInt8") return as<std::uint8_t>(bytes);
    throw Error("unknown type '" + type.substr(0, 20) + "' of a DataArray", at(array));
  }

  std::string name_;
  XmlElement root_;
  std::string_view appended_;
  bool appended_raw_ = false, compressed_ = false;
  std::size_t header_size_ = 4;
  std::endian order_ = std::endian::little;
};

class VtuWriter {
 public:
  VtuWriter(const MeshData& mesh, bool binary) : mesh_(mesh), binary_(binary) {}

  std::string write() {
    const Eigen::Index triangles = mesh_.triangles.rows(), tets = mesh_.tetrahedra.rows();
    text(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" "
        "header_type=\"UInt64\">\n<!-- metres -->\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" "
        "NumberOfCells=\"{}\">\n<Points>\n",
        mesh_.points_m.rows(), triangles + tets);
    array<double>("Points", "Float64", 3, flat(mesh_.points_m));
    out_ += "</Points>\n<Cells>\n";
    // Tetrahedra first: cell fields speak of them.
    std::vector<std::int64_t> connectivity, offsets;
    std::vector<std::uint8_t> types;
    const auto add = [&](const auto& cells, std::uint8_t type) {
      for (Eigen::Index i = 0; i < cells.rows(); ++i) {
        for (Eigen::Index k = 0; k < cells.cols(); ++k) connectivity.push_back(cells(i, k));
        offsets.push_back(static_cast<std::int64_t>(connectivity.size()));
        types.push_back(type);
      }
    };
    add(mesh_.tetrahedra, mesh_.tetrahedra.cols() == 10 ? 24 : 10);
    add(mesh_.triangles, 5);
    array<std::int64_t>("connectivity", "Int64", 1, connectivity);
    array<std::int64_t>("offsets", "Int64", 1, offsets);
    array<std::uint8_t>("types", "UInt8", 1, types);
    out_ += "</Cells>\n";
    fields("PointData", mesh_.point_fields, mesh_.points_m.rows());
    fields("CellData", mesh_.cell_fields, triangles + tets);
    out_ += "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
    return std::move(out_);
  }

 private:
  template <typename... Args>
  void text(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(out_), format, std::forward<Args>(args)...);
  }
  template <typename Matrix>
  static std::vector<double> flat(const Matrix& matrix) {
    std::vector<double> result;
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      for (Eigen::Index k = 0; k < matrix.cols(); ++k) result.push_back(matrix(i, k));
    }
    return result;
  }
  template <typename T>
  void array(const std::string& name, const char* type, Eigen::Index components, const std::vector<T>& values) {
    text("<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"{}\">\n", type, xml_escaped(name),
         components, binary_ ? "binary" : "ascii");
    if (binary_) {
      std::string bytes;
      bytes.reserve(8 + values.size() * sizeof(T));
      store(bytes, static_cast<std::uint64_t>(values.size() * sizeof(T)));
      for (const T value : values) store(bytes, value);
      out_ += base64_encoded(bytes);
    } else {
      for (std::size_t i = 0; i < values.size(); ++i) {
        const bool end = (i + 1) % static_cast<std::size_t>(components == 1 ? 16 : components) == 0;
        if constexpr (std::is_same_v<T, double>) {
          text("{}{}", values[i], end ? '\n' : ' ');
        } else {
          text("{}{}", static_cast<std::int64_t>(values[i]), end ? '\n' : ' ');
        }
      }
    }
    out_ += "\n</DataArray>\n";
  }
  void fields(const char* section, const std::map<std::string, MatrixX>& all, Eigen::Index count) {
    text("<{}>\n", section);
    for (const auto& [name, values] : all) {
      MatrixX padded = MatrixX::Zero(count, values.cols());  // triangles beside tetrahedra carry zeros
      padded.topRows(std::min(count, values.rows())) = values.topRows(std::min(count, values.rows()));
      array<double>(name, "Float64", values.cols(), flat(padded));
    }
    text("</{}>\n", section);
  }

  const MeshData& mesh_;
  bool binary_;
  std::string out_;
};

}  // namespace

MeshData read_vtu(std::string_view bytes, const std::string& name) { return VtuReader(bytes, name).read(); }
std::string write_vtu(const MeshData& mesh) { return VtuWriter(mesh, true).write(); }
std::string write_vtu_ascii(const MeshData& mesh) { return VtuWriter(mesh, false).write(); }

}  // namespace palpate::io
