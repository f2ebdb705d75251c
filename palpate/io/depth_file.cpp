// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/depth_file.hpp"

#include <fmt/format.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/io/bytes.hpp"
#include "palpate/io/png_image.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate::io {
namespace {

constexpr std::string_view npy_magic = "\x93NUMPY";
constexpr std::int64_t largest_side = 20000;

/// NumPy's .npy of two dimensions (format versions 1 to 3), any of the types that images come in.
MatrixX parse_npy(std::string_view bytes, const std::string& name) {
  Scanner file(bytes, name);
  file.take(npy_magic.size(), "the magic word");
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
  const auto columns = comma == std::string_view::npos ? std::nullopt : parse_whole(trimmed(shape.substr(comma + 1)));
  if (!rows || !columns || *rows < 1 || *columns < 1 || *rows > largest_side || *columns > largest_side) {
    file.fail("the array has shape (" + std::string(shape.substr(0, 40)) + "); rows x columns of an image are needed");
  }
  const auto count = static_cast<std::size_t>(*rows * *columns);
  // Memory is asked for only once the bytes are known to be there: at least one a pixel.
  file.check_count(count, "the number of pixels", 1);
  MatrixX values(*rows, *columns);
  const auto fill = [&]<typename T>(T) {
    const std::string_view data = file.take(count * sizeof(T), "the pixels");
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

bool is_npy(std::string_view bytes) { return bytes.substr(0, npy_magic.size()) == npy_magic; }

}  // namespace

DepthImage parse_depth(std::string_view bytes, const std::string& name, double depth_unit_m) {
  if (bytes.empty()) throw Error("the file is empty; record the image again", name);
  DepthImage depth;
  if (is_npy(bytes)) {
    const MatrixX values = parse_npy(bytes, name);
    depth = (values * depth_unit_m).cast<float>();
    for (float* pixel = depth.data(); pixel != depth.data() + depth.size(); ++pixel) {
      if (!std::isfinite(*pixel)) *pixel = 0;
      if (*pixel < 0)
        throw Error("holds a negative depth; depth is positive along the optical axis, 0 where there is none", name);
    }
  } else {
    const GreyImage image = parse_png(bytes, name);
    if (image.bits != 16) throw Error("is an 8-bit image, depth needs 16 bits; was it a preview that was saved?", name);
    depth.resize(image.height, image.width);
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      depth.data()[i] = static_cast<float>(image.pixels[i] * depth_unit_m);
  }
  if ((depth.array() > 0).count() == 0)
    throw Error("no pixel of the depth image holds data; record it again or remove the observation", name);
  return depth;
}

MaskImage parse_mask(std::string_view bytes, const std::string& name) {
  if (is_npy(bytes)) return (parse_npy(bytes, name).array() != 0).cast<std::uint8_t>();
  const GreyImage image = parse_png(bytes, name);
  MaskImage mask(image.height, image.width);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) mask.data()[i] = image.pixels[i] != 0 ? 1 : 0;
  return mask;
}

std::string depth_png(const DepthImage& depth_m, double depth_unit_m) {
  GreyImage image{static_cast<int>(depth_m.cols()), static_cast<int>(depth_m.rows()), 16, {}};
  image.pixels.reserve(static_cast<std::size_t>(depth_m.size()));
  for (const float* pixel = depth_m.data(); pixel != depth_m.data() + depth_m.size(); ++pixel) {
    const double units = std::round(static_cast<double>(*pixel) / depth_unit_m);
    if (!(units >= 0 && units <= 65535))
      throw Error("a depth does not fit 16 bits; choose a larger unit or .npy", "depth_png: depth_unit_m");
    image.pixels.push_back(static_cast<std::uint16_t>(units));
  }
  return png_bytes(image);
}

std::string mask_png(const MaskImage& mask) {
  GreyImage image{static_cast<int>(mask.cols()), static_cast<int>(mask.rows()), 8, {}};
  for (const std::uint8_t* pixel = mask.data(); pixel != mask.data() + mask.size(); ++pixel)
    image.pixels.push_back(*pixel != 0 ? 255 : 0);
  return png_bytes(image);
}

std::string depth_npy(const DepthImage& depth_m) {
  std::string header =
      fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}", depth_m.rows(), depth_m.cols());
  const std::size_t unpadded = npy_magic.size() + 4 + header.size() + 1;
  header.append((64 - unpadded % 64) % 64, ' ');
  header += '\n';
  std::string out(npy_magic);
  out += '\x01';
  out += '\0';
  store(out, static_cast<std::uint16_t>(header.size()));
  out += header;
  for (const float* pixel = depth_m.data(); pixel != depth_m.data() + depth_m.size(); ++pixel) store(out, *pixel);
  return out;
}

}  // namespace palpate::io
