// SPDX-License-Identifier: Apache-2.0
// The compressedDepth transport, written by the tests' own hands: the product only reads it.
#pragma once

#include <cmath>
#include <string>

#include "palpate/io/bytes.hpp"
#include "palpate/io/message_bytes.hpp"
#include "palpate/io/png_image.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::io::test {

/// What 32FC1 is quantised by (image_transport_plugins, compressed_depth_image_transport/codec.cpp): a pixel is A / depth + B.
constexpr float depth_quantisation = 100, depth_most_m = 10;
constexpr float inverse_a = depth_quantisation * (depth_quantisation + 1), inverse_b = 1 - inverse_a / depth_most_m;

/// 12 bytes of its own, then a PNG of 16 bits: millimetres, or quantised inverse depth.
inline std::string compressed_depth(const DepthImage& depth_m, bool inverse) {
  GreyImage image{static_cast<int>(depth_m.cols()), static_cast<int>(depth_m.rows()), 16, {}};
  for (Eigen::Index i = 0; i < depth_m.size(); ++i) {
    const float depth = depth_m.data()[i], value = inverse ? inverse_a / depth + inverse_b : 1000 * depth;
    image.pixels.push_back(static_cast<std::uint16_t>(depth > 0 ? std::lround(value) : 0));
  }
  std::string data;
  store(data, std::uint32_t{0});
  store(data, inverse ? inverse_a : 0.0f);
  store(data, inverse ? inverse_b : 0.0f);
  return data + png_bytes(image);
}

inline std::string compressed_depth_message(const RosHeader& header, const DepthImage& depth_m, bool inverse = false) {
  CdrWriter out;
  out.number(static_cast<std::int32_t>(header.stamp_ns / 1000000000)).number(static_cast<std::uint32_t>(header.stamp_ns % 1000000000));
  out.text(header.frame).text(inverse ? "32FC1; compressedDepth" : "16UC1; compressedDepth");
  return out.octets(compressed_depth(depth_m, inverse)).take();
}

}  // namespace palpate::io::test
