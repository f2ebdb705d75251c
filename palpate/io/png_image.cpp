// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/png_image.hpp"

#include <png.h>

#include <cstring>

#include "palpate/core/error.hpp"

namespace palpate::io {
namespace {

constexpr png_uint_32 largest_side = 20000;

struct Source {
  std::string_view bytes;
  std::size_t at = 0;
  char message[120] = "";
  bool is_colour = false;
};

// libpng reports by a long jump: what lies between must have no destructor. It must not print either.
void on_error(png_structp png, png_const_charp message) {
  auto* source = static_cast<Source*>(png_get_error_ptr(png));
  std::strncpy(source->message, message, sizeof(source->message) - 1);
  png_longjmp(png, 1);
}
void on_warning(png_structp, png_const_charp) {}
void on_read(png_structp png, png_bytep out, png_size_t size) {
  auto* source = static_cast<Source*>(png_get_io_ptr(png));
  if (size > source->bytes.size() - source->at) png_error(png, "the file ends too early");
  std::memcpy(out, source->bytes.data() + source->at, size);
  source->at += size;
}
void on_write(png_structp png, png_bytep data, png_size_t size) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(data), size);
}
void on_flush(png_structp) {}

bool read_header(png_structp png, png_infop info, Source& source, GreyImage& image) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_set_read_fn(png, &source, on_read);
  png_read_info(png, info);
  const png_uint_32 width = png_get_image_width(png, info), height = png_get_image_height(png, info);
  if (width > largest_side || height > largest_side) png_error(png, "the image is larger than 20000 pixels a side");
  if (png_get_color_type(png, info) & PNG_COLOR_MASK_COLOR) {
    if (png_get_color_type(png, info) != PNG_COLOR_TYPE_PALETTE) {
      source.is_colour = true;
      png_error(png, "colour");
    }
    png_set_packing(png);  // palette indices stand for themselves: a mask
  } else if (png_get_bit_depth(png, info) < 8) {
    png_set_expand_gray_1_2_4_to_8(png);
  }
  if (png_get_color_type(png, info) & PNG_COLOR_MASK_ALPHA) png_set_strip_alpha(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  image.width = static_cast<int>(width);
  image.height = static_cast<int>(height);
  image.bits = png_get_bit_depth(png, info) == 16 ? 16 : 8;
  return true;
}

bool read_rows(png_structp png, png_infop info, png_bytepp rows) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_read_image(png, rows);
  png_read_end(png, info);
  return true;
}

bool write_rows(png_structp png, png_infop info, const GreyImage& image, png_bytepp rows, std::string& out) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_set_write_fn(png, &out, on_write, on_flush);
  png_set_compression_level(png, 6);
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.width), static_cast<png_uint_32>(image.height), image.bits,
               PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_rows(png, info, rows);
  png_write_png(png, info, PNG_TRANSFORM_IDENTITY, nullptr);
  return true;
}

}  // namespace

GreyImage parse_png(std::string_view bytes, const std::string& name) {
  if (bytes.size() < 8 || png_sig_cmp(reinterpret_cast<png_const_bytep>(bytes.data()), 0, 8) != 0) {
    throw Error("is not a PNG image", name);
  }
  Source source{bytes};
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &source, on_error, on_warning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  GreyImage image;
  bool good = info != nullptr && read_header(png, info, source, image);
  const std::size_t row_bytes = good ? png_get_rowbytes(png, info) : 0;
  // Deflate packs at most about 1030 to 1: a size beyond that is a damaged header, and no memory is asked for.
  if (good && row_bytes * static_cast<std::size_t>(image.height) / 1100 > bytes.size()) {
    good = false;
    std::strncpy(source.message, "the header announces more pixels than the file can hold", sizeof(source.message) - 1);
  }
  std::vector<png_byte> raw(good ? row_bytes * static_cast<std::size_t>(image.height) : 0);
  std::vector<png_bytep> rows(good ? static_cast<std::size_t>(image.height) : 0);
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = raw.data() + i * row_bytes;
  good = good && read_rows(png, info, rows.data());
  png_destroy_read_struct(&png, &info, nullptr);
  if (source.is_colour) throw Error("is a colour image, a grey one is needed (depth: 16 bits); was the colour camera's stream taken?", name);
  if (!good)
    throw Error("the PNG image is cut off or damaged (" + std::string(source.message) + "); copy or record it again", name);

  const std::size_t count = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  image.pixels.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = i / static_cast<std::size_t>(image.width) * row_bytes;
    const std::size_t column = i % static_cast<std::size_t>(image.width);
    image.pixels[i] = image.bits == 16 ? static_cast<std::uint16_t>(raw[at + 2 * column] << 8 | raw[at + 2 * column + 1])
                                       : raw[at + column];
  }
  return image;
}

std::string png_bytes(const GreyImage& image) {
  const std::size_t bytes_a_pixel = image.bits == 16 ? 2 : 1;
  const std::size_t row_bytes = bytes_a_pixel * static_cast<std::size_t>(image.width);
  std::vector<png_byte> raw(row_bytes * static_cast<std::size_t>(image.height));
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (image.bits == 16) {
      raw[2 * i] = static_cast<png_byte>(image.pixels[i] >> 8);
      raw[2 * i + 1] = static_cast<png_byte>(image.pixels[i] & 255);
    } else {
      raw[i] = static_cast<png_byte>(image.pixels[i]);
    }
  }
  std::vector<png_bytep> rows(static_cast<std::size_t>(image.height));
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = raw.data() + i * row_bytes;
  Source source;
  std::string out;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &source, on_error, on_warning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  const bool good = info != nullptr && write_rows(png, info, image, rows.data(), out);
  png_destroy_write_struct(&png, &info);
  if (!good) throw Error("the PNG image cannot be written: " + std::string(source.message), "png_bytes");
  return out;
}

}  // namespace palpate::io
