// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/depth_file.hpp"

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/io/npy.hpp"
#include "palpate/io/png_image.hpp"

namespace palpate::io {
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

std::string depth_npy(const DepthImage& depth_m) { return npy_bytes(depth_m.cast<double>()); }

}  // namespace palpate::io
