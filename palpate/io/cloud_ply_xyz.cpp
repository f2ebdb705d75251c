// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/io/bytes.hpp"
#include "palpate/io/cloud_formats.hpp"
#include "palpate/io/ply.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate::io {
namespace {

std::string ply_header(const CloudColumns& columns, const char* format) {
  std::string out = fmt::format("ply\nformat {} 1.0\ncomment metres\nelement vertex {}\n", format, columns.values.rows());
  for (const std::string& name : columns.names) out += "property double " + name + "\n";
  return out + "end_header\n";
}

void append_rows(std::string& out, const MatrixX& values) {
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    for (Eigen::Index k = 0; k < values.cols(); ++k) {
      fmt::format_to(std::back_inserter(out), "{}{}", values(i, k), k + 1 == values.cols() ? '\n' : ' ');
    }
  }
}

}  // namespace

PointCloud read_ply_cloud(std::string_view bytes, const std::string& name) {
  for (const PlyElement& element : parse_ply(bytes, name)) {
    if (element.name == "vertex") return cloud_from_columns(element.scalars, element.values, name);
  }
  throw Error("the PLY file has no element 'vertex'", name);
}

std::string write_ply_cloud(const PointCloud& cloud) {
  const CloudColumns columns = columns_of(cloud);
  std::string out = ply_header(columns, "binary_little_endian");
  for (Eigen::Index i = 0; i < columns.values.rows(); ++i) {
    for (Eigen::Index k = 0; k < columns.values.cols(); ++k) store(out, columns.values(i, k));
  }
  return out;
}

std::string write_ply_cloud_ascii(const PointCloud& cloud) {
  const CloudColumns columns = columns_of(cloud);
  std::string out = ply_header(columns, "ascii");
  append_rows(out, columns.values);
  return out;
}

PointCloud read_xyz(std::string_view bytes, const std::string& name) {
  std::vector<double> numbers;
  std::size_t columns = 0;
  Scanner file(bytes, name);
  for (std::size_t line_number = 1; file.remaining() > 0; ++line_number) {
    std::string_view line = file.line();
    line = trimmed(line.substr(0, line.find('#')));
    if (line.empty()) continue;
    std::size_t here = 0;
    while (!line.empty()) {
      const std::size_t end = std::min(line.find_first_of(", \t;"), line.size());
      const std::string_view text = line.substr(0, end);
      line.remove_prefix(std::min(end + 1, line.size()));
      if (text.empty()) continue;
      const auto value = parse_number(text);
      const std::string where = name + ":" + std::to_string(line_number);
      if (!value)
        throw Error("'" + std::string(text.substr(0, 20)) + "' is not a number; a line holds x y z in metres", where);
      if (!std::isfinite(*value)) throw Error("holds a number that is not finite; leave invalid points out", where);
      numbers.push_back(*value);
      ++here;
    }
    if (columns == 0) columns = here;
    if (here != columns || (columns != 3 && columns != 6)) {
      throw Error("holds " + std::to_string(here) + " numbers; each line must hold three (x y z) or six (with the normal)",
                  name + ":" + std::to_string(line_number));
    }
  }
  if (columns == 0) return {};
  using Table = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto width = static_cast<Eigen::Index>(columns);
  const Table table = Eigen::Map<const Table>(numbers.data(), static_cast<Eigen::Index>(numbers.size()) / width, width);
  if (width == 6 && table.rightCols(3).cwiseAbs().maxCoeff() > 1.01)
    throw Error("the numbers behind x y z are taken for a unit normal, and are as large as " +
                    std::to_string(table.rightCols(3).cwiseAbs().maxCoeff()) + "; leave colours out",
                name);
  std::vector<std::string> names = {"x", "y", "z", "nx", "ny", "nz"};
  names.resize(columns);
  return cloud_from_columns(names, table, name);
}

std::string write_xyz(const PointCloud& cloud) {
  PointCloud without_sigma = cloud;
  without_sigma.sigma_m.resize(0);
  std::string out;
  append_rows(out, columns_of(without_sigma).values);
  return out;
}

}  // namespace palpate::io
