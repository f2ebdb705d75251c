// SPDX-License-Identifier: Apache-2.0
// Reading of Gmsh's MSH 2.2 and 4.1, text and binary (Gmsh reference manual, chapter "File formats").
#include <bit>
#include <unordered_map>

#include "palpate/io/bytes.hpp"
#include "palpate/io/mesh_builder.hpp"
#include "palpate/io/mesh_formats.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate::io {
namespace {

enum class Cell { skipped, triangle, quadrangle, tetrahedron, tetrahedron10, refused };
struct ElementType {
  int nodes;
  Cell cell;
};

ElementType element_type(std::int64_t type, const Scanner& file) {
  switch (type) {
    case 15:
      return {1, Cell::skipped};
    case 1:
      return {2, Cell::skipped};
    case 8:
      return {3, Cell::skipped};
    case 2:
      return {3, Cell::triangle};
    case 9:
      return {6, Cell::triangle};
    case 3:
      return {4, Cell::quadrangle};
    case 16:
      return {8, Cell::quadrangle};
    case 10:
      return {9, Cell::quadrangle};
    case 4:
      return {4, Cell::tetrahedron};
    case 11:
      return {10, Cell::tetrahedron10};
    default:
      file.fail("Gmsh element type " + std::to_string(type) +
                " is not read: only triangles, quadrangles and tetrahedra of 4 or 10 nodes are");
  }
}

/// Reads numbers of either kind of file, so that each section is written down once.
class GmshReader {
 public:
  explicit GmshReader(Scanner& file) : file_(file) {}

  MeshData read() {
    read_format();
    while (!file_.at_end()) {
      const std::string section(file_.word("a section"));
      if (section.size() < 2 || section.front() != '$')
        file_.fail("expected a section such as $Nodes, found '" + section.substr(0, 20) + "'");
      if (section == "$Nodes") {
        file_.line();
        version4_ ? read_nodes4() : read_nodes2();
      } else if (section == "$Elements") {
        file_.line();
        version4_ ? read_elements4() : read_elements2();
      } else {
        skip(section);
        continue;
      }
      file_.expect("$End" + section.substr(1));
    }
    if (!has_nodes_ || !has_elements_) file_.fail("the file ends without $Nodes or $Elements; it is cut off");
    return builder_.build(file_.name());
  }

 private:
  void read_format() {
    if (file_.peek_word() != "$MeshFormat") file_.fail("does not start with $MeshFormat; it is not a Gmsh file");
    file_.word("$MeshFormat");
    const std::string version(file_.word("the version"));
    if (version != "2.2" && version != "4.1") {
      file_.fail("Gmsh format " + version.substr(0, 10) + " is not read; save as 4.1 or 2.2 (gmsh -format msh41)");
    }
    version4_ = version == "4.1";
    binary_ = file_.whole("the file type", 0, 1) == 1;
    if (file_.whole("the data size", 1, 64) != 8) file_.fail("only 8-byte numbers are read");
    if (binary_) {
      file_.line();
      const char* one = file_.take(4, "the byte order").data();
      order_ = load<std::int32_t>(one, std::endian::little) == 1 ? std::endian::little : std::endian::big;
      if (load<std::int32_t>(one, order_) != 1) file_.fail("the byte order mark is damaged");
    }
    file_.expect("$EndMeshFormat");
  }

  void skip(const std::string& section) {
    const std::string end = "$End" + section.substr(1);
    const std::size_t found = file_.bytes().find(end, file_.position());
    if (found == std::string_view::npos) file_.fail("section " + section.substr(0, 30) + " has no end; the file is cut off");
    file_.seek(found + end.size());
  }

  std::int64_t int32(const char* what) {
    return binary_ ? load<std::int32_t>(file_.take(4, what).data(), order_) : file_.whole(what);
  }
  /// A count or tag of version 4: 8 bytes in binary files.
  std::int64_t size(const char* what) {
    const std::int64_t value = binary_ ? load<std::int64_t>(file_.take(8, what).data(), order_) : file_.whole(what);
    if (value < 0) file_.fail(std::string(what) + " is negative");
    return value;
  }
  std::size_t count(const char* what, std::size_t bytes_text, std::size_t bytes_binary) {
    const auto value = static_cast<std::size_t>(size(what));
    file_.check_count(value, what, binary_ ? bytes_binary : bytes_text);
    return value;
  }
  double real(const char* what) { return binary_ ? load<double>(file_.take(8, what).data(), order_) : file_.number(what); }

  void add_node(std::int64_t tag, double x, double y, double z) {
    if (!row_of_.emplace(tag, static_cast<Index>(builder_.points())).second)
      file_.fail("node " + std::to_string(tag) + " is there twice");
    builder_.point(x, y, z);
  }

  void read_nodes2() {
    has_nodes_ = true;
    const std::size_t nodes = file_.count("the number of nodes", binary_ ? 28 : 8);
    if (binary_) file_.line();
    builder_.reserve_points(nodes);
    for (std::size_t i = 0; i < nodes; ++i) {
      const std::int64_t tag = int32("a node's number");
      const double x = real("x"), y = real("y"), z = real("z");
      add_node(tag, x, y, z);
    }
  }

  void read_nodes4() {
    has_nodes_ = true;
    const std::size_t blocks = count("the number of node blocks", 2, 20);
    const std::size_t nodes = count("the number of nodes", 8, 32);
    size("the least tag");
    size("the largest tag");
    builder_.reserve_points(nodes);
    std::vector<std::int64_t> tags;
    for (std::size_t block = 0; block < blocks; ++block) {
      const std::int64_t dimension = int32("the entity's dimension");
      int32("the entity's tag");
      const bool parametric = int32("parametric") != 0;
      const std::size_t here = count("the number of nodes of a block", 8, 32);
      tags.resize(here);
      for (std::int64_t& tag : tags) tag = size("a node's tag");
      for (const std::int64_t tag : tags) {
        const double x = real("x"), y = real("y"), z = real("z");
        for (std::int64_t k = 0; parametric && k < dimension; ++k) real("a parametric coordinate");
        add_node(tag, x, y, z);
      }
    }
    if (builder_.points() != nodes)
      file_.fail("$Nodes announces " + std::to_string(nodes) + " nodes and holds " + std::to_string(builder_.points()));
  }

  Index row_of(std::int64_t tag) {
    const auto found = row_of_.find(tag);
    if (found == row_of_.end()) file_.fail("an element refers to node " + std::to_string(tag) + ", which is not there");
    return found->second;
  }

  template <typename NextTag>
  void read_cell(const ElementType& type, NextTag next_tag) {
    Index node[10] = {};
    for (int k = 0; k < type.nodes; ++k) {
      const Index row = row_of(next_tag());
      if (k < 10) node[k] = row;
    }
    switch (type.cell) {
      case Cell::triangle:
        builder_.triangle(node[0], node[1], node[2]);
        break;
      case Cell::quadrangle:
        builder_.polygon({node[0], node[1], node[2], node[3]});
        break;
      case Cell::tetrahedron:
        builder_.tetrahedron(node, 4);
        break;
      case Cell::tetrahedron10:
        std::swap(node[8], node[9]);  // Gmsh numbers the edges 01 12 02 03 23 13
        builder_.tetrahedron(node, 10);
        break;
      case Cell::skipped:
      case Cell::refused:
        break;
    }
  }

  void read_elements2() {
    has_elements_ = true;
    const std::size_t elements = file_.count("the number of elements", 4);
    if (binary_) file_.line();
    const auto next_node = [&] { return int32("a node of an element"); };
    for (std::size_t i = 0; i < elements;) {
      std::int64_t same = 1, tags = 0;
      if (!binary_) int32("an element's number");
      const ElementType type = element_type(int32("an element's type"), file_);
      if (binary_) same = int32("the number of elements that follow");
      tags = int32("the number of tags");
      if (same < 1 || static_cast<std::size_t>(same) > elements - i || tags < 0 || tags > 100)
        file_.fail("the header of an element is damaged");
      for (std::int64_t k = 0; k < same; ++k) {
        if (binary_) int32("an element's number");
        for (std::int64_t t = 0; t < tags; ++t) int32("a tag");
        read_cell(type, next_node);
      }
      i += static_cast<std::size_t>(same);
    }
  }

  void read_elements4() {
    has_elements_ = true;
    const std::size_t blocks = count("the number of element blocks", 2, 20);
    const std::size_t elements = count("the number of elements", 4, 16);
    size("the least tag");
    size("the largest tag");
    std::size_t total = 0;
    const auto next_node = [&] { return size("a node of an element"); };
    for (std::size_t block = 0; block < blocks; ++block) {
      int32("the entity's dimension");
      int32("the entity's tag");
      const ElementType type = element_type(int32("an element's type"), file_);
      const std::size_t here = count("the number of elements of a block", 4, 16);
      total += here;
      for (std::size_t i = 0; i < here; ++i) {
        size("an element's tag");
        read_cell(type, next_node);
      }
    }
    if (total != elements)
      file_.fail("$Elements announces " + std::to_string(elements) + " elements and holds " + std::to_string(total));
  }

  Scanner& file_;
  MeshBuilder builder_;
  std::unordered_map<std::int64_t, Index> row_of_;
  bool version4_ = false, binary_ = false, has_nodes_ = false, has_elements_ = false;
  std::endian order_ = std::endian::little;
};

}  // namespace

MeshData read_gmsh(std::string_view bytes, const std::string& name) {
  Scanner file(bytes, name);
  return GmshReader(file).read();
}

}  // namespace palpate::io
