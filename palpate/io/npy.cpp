// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/npy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "palpate/io/bytes.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate::io {
namespace {

constexpr std::string_view npy_magic = "\x93NUMPY";
constexpr std::int64_t largest_array_side = 100000000;

}  // namespace

bool is_npy(std::string_view bytes) { return bytes.substr(0, npy_magic.size()) == npy_magic; }

MatrixX parse_npy(std::string_view bytes, const std::string& name) {
  Scanner file(bytes, name);
  if (file.take(npy_magic.size(), "the magic word") != npy_magic) file.fail("is not an .npy file");
  const char major = file.take(2, "the version")[0];
  const std::size_t header_size = major == 1 ? load<std::uint16_t>(file.take(2, "the header's size").data())
                                             : load<std::uint32_t>(file.take(4, "the header's size").data());
  const std::string_view header = file.take(header_size, "the header");
  const auto after = [&](std::string_view key) {
    const std::size_t found = header.find(key);
    if (found == std::string_view::npos) file.fail("the .npy header has no " + std::string(key));
    return trimmed(header.substr(std::min(found + key.size(), header.size())));
  };
  std::string_view type = after("'descr':");
  type = type.substr(0, type.find(','));
  if (after("'fortran_order':").substr(0, 5) != "False")
    file.fail("the array is in Fortran order; save it with numpy.ascontiguousarray");
  std::string_view shape = after("'shape':");
  if (shape.empty() || shape.front() != '(') file.fail("the .npy header has no shape");
  shape = shape.substr(1, shape.find(')') - 1);
  const std::size_t comma = shape.find(',');
  const auto rows = parse_whole(trimmed(shape.substr(0, comma)));
  const std::string_view second = comma == std::string_view::npos ? "" : trimmed(shape.substr(comma + 1));
  const auto columns = second.empty() ? std::optional<std::int64_t>(1) : parse_whole(second);
  if (!rows || !columns || *rows < 1 || *columns < 1 || *rows > largest_array_side || *columns > largest_array_side) {
    file.fail("the array has shape (" + std::string(shape.substr(0, 40)) + "); one or two dimensions are read");
  }
  const auto count = static_cast<std::size_t>(*rows * *columns);
  // Memory is asked for only once the bytes are known to be there: at least one a value.
  file.check_count(count, "the number of values", 1);
  MatrixX values(*rows, *columns);
  const auto fill = [&]<typename T>(T) {
    const std::string_view data = file.take(count * sizeof(T), "the values");
    for (std::int64_t i = 0; i < *rows * *columns; ++i) {
      values(i / *columns, i % *columns) =
          static_cast<double>(load<T>(data.data() + static_cast<std::size_t>(i) * sizeof(T)));
    }
  };
  if (type == "'<f4'")
    fill(float{});
  else if (type == "'<f8'")
    fill(double{});
  else if (type == "'<u2'")
    fill(std::uint16_t{});
  else if (type == "'|u1'")
    fill(std::uint8_t{});
  else if (type == "'|b1'")
    fill(std::uint8_t{});
  else
    file.fail("arrays of type " + std::string(type.substr(0, 10)) +
              " are not read: float32, float64, uint16, uint8 and bool are");
  return values;
}

std::string npy_bytes(const MatrixX& values, NpyType type) {
  const std::string shape =
      values.cols() == 1 ? fmt::format("({},)", values.rows()) : fmt::format("({}, {})", values.rows(), values.cols());
  std::string header = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': {}, }}", type == NpyType::float64 ? "<f8" : "<f4", shape);
  const std::size_t unpadded = npy_magic.size() + 4 + header.size() + 1;
  header.append((64 - unpadded % 64) % 64, ' ');
  header += '\n';
  std::string out(npy_magic);
  out += '\x01';
  out += '\0';
  store(out, static_cast<std::uint16_t>(header.size()));
  out += header;
  for (Eigen::Index row = 0; row < values.rows(); ++row) {
    for (Eigen::Index column = 0; column < values.cols(); ++column) {
      if (type == NpyType::float64)
        store(out, values(row, column));
      else
        store(out, static_cast<float>(values(row, column)));
    }
  }
  return out;
}

}  // namespace palpate::io
