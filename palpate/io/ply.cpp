// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/ply.hpp"

#include <algorithm>
#include <bit>
#include <limits>

#include "palpate/io/bytes.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate::io {
namespace {

enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };
constexpr std::size_t size_of(Type type) {
  constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<int>(type)];
}

Type type_named(std::string_view word, const Scanner& file) {
  constexpr std::pair<std::string_view, Type> names[] = {
      {"char", Type::int8},     {"int8", Type::int8},       {"uchar", Type::uint8},    {"uint8", Type::uint8},
      {"short", Type::int16},   {"int16", Type::int16},     {"ushort", Type::uint16},  {"uint16", Type::uint16},
      {"int", Type::int32},     {"int32", Type::int32},     {"uint", Type::uint32},    {"uint32", Type::uint32},
      {"float", Type::float32}, {"float32", Type::float32}, {"double", Type::float64}, {"float64", Type::float64}};
  for (const auto& [name, type] : names) {
    if (name == word) return type;
  }
  file.fail("'" + std::string(word.substr(0, 20)) + "' is not a PLY type");
}

struct Property {
  std::string name;
  bool is_list = false;
  Type count_type = Type::uint8;
  Type type = Type::float32;
};

struct PlyHeader {
  bool ascii = false;
  std::endian order = std::endian::little;
  std::vector<PlyElement> elements;
  std::vector<std::vector<Property>> properties;
};

PlyHeader parse_ply_header(Scanner& file) {
  PlyHeader header;
  if (trimmed(file.line()) != "ply") {
    file.seek(0);
    file.fail("does not start with 'ply'; it is not a PLY file");
  }
  bool has_format = false;
  while (true) {
    const std::string_view key = file.word("the PLY header");
    if (key == "end_header") {
      if (!trimmed(file.line()).empty()) file.fail("text after 'end_header'");
      break;
    }
    if (key == "comment" || key == "obj_info") {
      file.line();
    } else if (key == "format") {
      const std::string_view format = file.word("the format");
      header.ascii = format == "ascii";
      header.order = format == "binary_big_endian" ? std::endian::big : std::endian::little;
      if (!header.ascii && format != "binary_little_endian" && format != "binary_big_endian")
        file.fail("unknown PLY format");
      file.word("the version");
      has_format = true;
    } else if (key == "element") {
      PlyElement element;
      element.name = std::string(file.word("the element's name"));
      element.rows = static_cast<std::size_t>(file.whole("the number of elements", 0, std::numeric_limits<Index>::max()));
      header.elements.push_back(std::move(element));
      header.properties.emplace_back();
    } else if (key == "property") {
      if (header.elements.empty()) file.fail("a property stands before any element");
      Property property;
      std::string_view type = file.word("a type");
      property.is_list = type == "list";
      if (property.is_list) {
        property.count_type = type_named(file.word("a type"), file);
        type = file.word("a type");
      }
      property.type = type_named(type, file);
      property.name = std::string(file.word("the property's name"));
      (property.is_list ? header.elements.back().lists : header.elements.back().scalars).push_back(property.name);
      header.properties.back().push_back(std::move(property));
    } else {
      file.fail("unknown key '" + std::string(key.substr(0, 20)) + "' in the PLY header");
    }
  }
  if (!has_format) file.fail("the PLY header names no format");
  return header;
}

/// One value of either kind of file.
double next_value(Scanner& file, const PlyHeader& header, Type type) {
  if (header.ascii) {
    const std::string_view text = file.word("a value");
    const auto value = parse_number(text);  // may be nan: whoever needs the value judges it
    if (!value) file.fail("expected a number, found '" + std::string(text.substr(0, 20)) + "'");
    return *value;
  }
  const char* raw = file.take(size_of(type), "the data").data();
  switch (type) {
    case Type::int8:
      return load<std::int8_t>(raw, header.order);
    case Type::uint8:
      return load<std::uint8_t>(raw, header.order);
    case Type::int16:
      return load<std::int16_t>(raw, header.order);
    case Type::uint16:
      return load<std::uint16_t>(raw, header.order);
    case Type::int32:
      return load<std::int32_t>(raw, header.order);
    case Type::uint32:
      return load<std::uint32_t>(raw, header.order);
    case Type::float32:
      return static_cast<double>(load<float>(raw, header.order));
    case Type::float64:
      return load<double>(raw, header.order);
  }
  return 0;
}

Index next_index(Scanner& file, const PlyHeader& header, Type type) {
  const double value = next_value(file, header, type);
  if (!(value >= 0 && value <= std::numeric_limits<Index>::max()) ||
      value != static_cast<double>(static_cast<Index>(value))) {
    file.fail("a list holds something that is not an index");
  }
  return static_cast<Index>(value);
}

void read_element(Scanner& file, const PlyHeader& header, const std::vector<Property>& properties, PlyElement& element) {
  std::size_t least = 0;  // bytes of one row, at least
  for (const Property& property : properties) {
    least += header.ascii ? 2 : property.is_list ? size_of(property.count_type) : size_of(property.type);
  }
  if (element.rows > 0 && properties.empty()) file.fail("element '" + element.name + "' has no property");
  file.check_count(element.rows, "the number of '" + element.name + "' elements", least);
  element.values.resize(static_cast<Eigen::Index>(element.rows), static_cast<Eigen::Index>(element.scalars.size()));
  element.list_values.assign(element.lists.size(), std::vector<std::vector<Index>>(element.rows));
  for (std::size_t row = 0; row < element.rows; ++row) {
    Eigen::Index scalar = 0;
    std::size_t list = 0;
    for (const Property& property : properties) {
      if (!property.is_list) {
        element.values(static_cast<Eigen::Index>(row), scalar++) = next_value(file, header, property.type);
        continue;
      }
      const auto count = static_cast<std::size_t>(next_index(file, header, property.count_type));
      file.check_count(count, "the length of a list", header.ascii ? 2 : size_of(property.type));
      std::vector<Index>& values = element.list_values[list++][row];
      values.reserve(count);
      // A list that is not of indices (texture coordinates) is passed over without a judgement.
      const bool of_indices = property.type != Type::float32 && property.type != Type::float64;
      for (std::size_t k = 0; k < count; ++k) {
        if (of_indices) {
          values.push_back(next_index(file, header, property.type));
        } else {
          next_value(file, header, property.type);
        }
      }
    }
  }
}

}  // namespace

std::optional<Eigen::Index> PlyElement::column(std::string_view property) const {
  const auto found = std::find(scalars.begin(), scalars.end(), property);
  if (found == scalars.end()) return std::nullopt;
  return found - scalars.begin();
}

std::vector<PlyElement> parse_ply(std::string_view bytes, const std::string& name) {
  Scanner file(bytes, name);
  PlyHeader header = parse_ply_header(file);
  for (std::size_t i = 0; i < header.elements.size(); ++i)
    read_element(file, header, header.properties[i], header.elements[i]);
  return std::move(header.elements);
}

}  // namespace palpate::io
