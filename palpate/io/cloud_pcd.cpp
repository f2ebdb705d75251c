// SPDX-License-Identifier: Apache-2.0
// PCD 0.7 of the Point Cloud Library: text, binary and binary compressed (LZF, one column after the other).
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/io/bytes.hpp"
#include "palpate/io/cloud_formats.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate::io {
namespace {

struct Field {
  std::string name;
  std::size_t size = 4;
  char type = 'F';
  std::size_t count = 1;
};

struct PcdHeader {
  std::vector<Field> fields;
  std::size_t width = 0, height = 1, points = 0;
  std::string data;
  std::size_t point_bytes() const {
    std::size_t sum = 0;
    for (const Field& field : fields) sum += field.size * field.count;
    return sum;
  }
};

PcdHeader parse_pcd_header(Scanner& file) {
  PcdHeader header;
  bool has_points = false;
  while (header.data.empty()) {
    std::string_view line = file.line();
    if (file.remaining() == 0) file.fail("the file ends within the header; it is not a PCD file or cut off");
    line = trimmed(line.substr(0, line.find('#')));
    if (line.empty()) continue;
    Scanner words(line, file.name());
    const std::string key(words.word("a key"));
    const auto each = [&](auto set) {
      for (Field& field : header.fields) {
        if (words.at_end()) file.fail("line " + key + " has fewer entries than FIELDS");
        set(field, words.word(key));
      }
    };
    const auto number = [&] {
      const auto value = parse_whole(words.peek_word());
      if (!value || *value < 0 || *value > std::numeric_limits<Index>::max()) file.fail(key + " is not a count");
      return static_cast<std::size_t>(*value);
    };
    if (key == "FIELDS") {
      while (!words.at_end()) header.fields.push_back({std::string(words.word("a field"))});
    } else if (key == "SIZE") {
      each([&](Field& field, std::string_view text) {
        field.size = static_cast<std::size_t>(parse_whole(text).value_or(0));
      });
    } else if (key == "TYPE") {
      each([&](Field& field, std::string_view text) { field.type = text[0]; });
    } else if (key == "COUNT") {
      each([&](Field& field, std::string_view text) {
        field.count = static_cast<std::size_t>(parse_whole(text).value_or(0));
      });
    } else if (key == "WIDTH") {
      header.width = number();
    } else if (key == "HEIGHT") {
      header.height = number();
    } else if (key == "POINTS") {
      header.points = number();
      has_points = true;
    } else if (key == "DATA") {
      header.data = std::string(words.word("the kind of data"));
    } else if (key != "VERSION" && key != "VIEWPOINT") {
      file.fail("unknown key '" + key.substr(0, 20) + "' in the PCD header");
    }
  }
  if (header.width > 0 && header.height > std::numeric_limits<Index>::max() / header.width)
    file.fail("WIDTH x HEIGHT is too large");
  if (!has_points) header.points = header.width * header.height;
  if (header.points != header.width * header.height) file.fail("POINTS is not WIDTH x HEIGHT");
  for (const Field& field : header.fields) {
    const bool real = field.type == 'F' && (field.size == 4 || field.size == 8);
    const bool whole = (field.type == 'I' || field.type == 'U') &&
                       (field.size == 1 || field.size == 2 || field.size == 4 || field.size == 8);
    if (!(real || whole) || field.count < 1 || field.count > 10000)
      file.fail("field '" + field.name.substr(0, 20) + "' has an unknown SIZE, TYPE or COUNT");
  }
  if (header.fields.empty()) file.fail("the PCD header has no FIELDS");
  return header;
}

double value_of(const Field& field, const char* raw) {
  switch (field.type) {
    case 'F':
      return field.size == 4 ? static_cast<double>(load<float>(raw)) : load<double>(raw);
    case 'I':
      return field.size == 1   ? load<std::int8_t>(raw)
             : field.size == 2 ? load<std::int16_t>(raw)
             : field.size == 4 ? load<std::int32_t>(raw)
                               : static_cast<double>(load<std::int64_t>(raw));
    default:
      return field.size == 1   ? load<std::uint8_t>(raw)
             : field.size == 2 ? load<std::uint16_t>(raw)
             : field.size == 4 ? load<std::uint32_t>(raw)
                               : static_cast<double>(load<std::uint64_t>(raw));
  }
}

/// LZF: a control byte below 32 copies that many + 1 letters, another one repeats a piece of what was written.
std::string unpacked(std::string_view packed, std::size_t size, const Scanner& file) {
  std::string out;
  out.reserve(size);
  const auto damaged = [&] { file.fail("the compressed data are damaged"); };
  for (std::size_t at = 0; at < packed.size();) {
    const auto control = static_cast<unsigned char>(packed[at++]);
    if (control < 32) {
      const std::size_t letters = control + 1u;
      if (letters > packed.size() - at || letters > size - out.size()) damaged();
      out.append(packed.substr(at, letters));
      at += letters;
      continue;
    }
    std::size_t length = control >> 5;
    if (length == 7) {
      if (at >= packed.size()) damaged();
      length += static_cast<unsigned char>(packed[at++]);
    }
    if (at >= packed.size()) damaged();
    const std::size_t back = ((control & 31u) << 8) + static_cast<unsigned char>(packed[at++]) + 1;
    length += 2;
    if (back > out.size() || length > size - out.size()) damaged();
    for (std::size_t i = 0; i < length; ++i) out += out[out.size() - back];
  }
  if (out.size() != size) damaged();
  return out;
}

MatrixX read_values(Scanner& file, const PcdHeader& header) {
  const std::size_t point_bytes = header.point_bytes();
  std::size_t numbers_a_point = 0;
  for (const Field& field : header.fields) numbers_a_point += field.count;
  std::string unpacked_data;
  std::string_view data;
  if (header.data == "ascii") {
    file.check_count(header.points * numbers_a_point, "the number of values", 2);
  } else if (header.data == "binary") {
    file.check_count(header.points, "the number of points", point_bytes);
    data = file.take(header.points * point_bytes, "the points");
  } else if (header.data == "binary_compressed") {
    const std::size_t packed = load<std::uint32_t>(file.take(4, "the compressed size").data());
    const std::size_t size = load<std::uint32_t>(file.take(4, "the size").data());
    if (size != header.points * point_bytes) file.fail("the size of the data does not fit the number of points");
    if (size > 300 * packed + 64) file.fail("the compressed data are damaged");  // LZF packs at most 264 bytes into 3
    unpacked_data = unpacked(file.take(packed, "the compressed data"), size, file);
    data = unpacked_data;
  } else {
    file.fail("DATA " + header.data.substr(0, 20) + " is not read: ascii, binary and binary_compressed are");
  }
  const auto rows = static_cast<Eigen::Index>(header.points);
  MatrixX values(rows, static_cast<Eigen::Index>(header.fields.size()));
  if (header.data == "ascii") {
    for (Eigen::Index row = 0; row < rows; ++row) {
      Eigen::Index column = 0;
      for (const Field& field : header.fields) {
        for (std::size_t k = 0; k < field.count; ++k) {
          const std::string_view text = file.word("a value");
          const auto value = parse_number(text);
          if (!value) file.fail("expected a number, found '" + std::string(text.substr(0, 20)) + "'");
          if (k == 0) values(row, column) = *value;
        }
        ++column;
      }
    }
    return values;
  }
  const bool by_column = header.data == "binary_compressed";
  std::size_t offset = 0;
  for (std::size_t f = 0; f < header.fields.size(); ++f) {
    const Field& field = header.fields[f];
    const std::size_t stride = by_column ? field.size * field.count : point_bytes;
    for (std::size_t row = 0; row < header.points; ++row) {
      values(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(f)) =
          value_of(field, data.data() + offset + row * stride);
    }
    offset += field.size * field.count * (by_column ? header.points : 1);
  }
  return values;
}

std::string pcd_header(const CloudColumns& columns, const char* data) {
  std::string fields, sizes, types, counts;
  for (const std::string& name : columns.names) {
    const bool normal = name.size() == 2 && name[0] == 'n';
    fields += normal ? " normal_" : " ";
    fields += normal ? name.substr(1) : name;
    sizes += " 8", types += " F", counts += " 1";
  }
  return fmt::format(
      "# .PCD v0.7, metres\nVERSION 0.7\nFIELDS{}\nSIZE{}\nTYPE{}\nCOUNT{}\nWIDTH {}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 "
      "0\nPOINTS {}\nDATA {}\n",
      fields, sizes, types, counts, columns.values.rows(), columns.values.rows(), data);
}

}  // namespace

PointCloud read_pcd(std::string_view bytes, const std::string& name) {
  Scanner file(bytes, name);
  const PcdHeader header = parse_pcd_header(file);
  std::vector<std::string> names;
  for (const Field& field : header.fields) names.push_back(field.name);
  PointCloud cloud = cloud_from_columns(names, read_values(file, header), name);
  if (header.height <= 1) return cloud;
  Eigen::Index kept = 0;
  for (Eigen::Index i = 0; i < cloud.points_m.rows(); ++i) {
    if (!cloud.points_m.row(i).allFinite()) continue;
    if (cloud.normals.rows() > 0) cloud.normals.row(kept) = cloud.normals.row(i);
    if (cloud.sigma_m.size() > 0) cloud.sigma_m[kept] = cloud.sigma_m[i];
    cloud.points_m.row(kept++) = cloud.points_m.row(i);
  }
  cloud.points_m.conservativeResize(kept, 3);
  if (cloud.normals.rows() > 0) cloud.normals.conservativeResize(kept, 3);
  if (cloud.sigma_m.size() > 0) cloud.sigma_m.conservativeResize(kept);
  return cloud;
}

std::string write_pcd(const PointCloud& cloud) {
  const CloudColumns columns = columns_of(cloud);
  std::string out = pcd_header(columns, "binary");
  for (Eigen::Index i = 0; i < columns.values.rows(); ++i) {
    for (Eigen::Index k = 0; k < columns.values.cols(); ++k) store(out, columns.values(i, k));
  }
  return out;
}

std::string write_pcd_ascii(const PointCloud& cloud) {
  const CloudColumns columns = columns_of(cloud);
  std::string out = pcd_header(columns, "ascii");
  for (Eigen::Index i = 0; i < columns.values.rows(); ++i) {
    for (Eigen::Index k = 0; k < columns.values.cols(); ++k) {
      fmt::format_to(std::back_inserter(out), "{}{}", columns.values(i, k), k + 1 == columns.values.cols() ? '\n' : ' ');
    }
  }
  return out;
}

}  // namespace palpate::io
