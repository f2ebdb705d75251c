// SPDX-License-Identifier: Apache-2.0
// What figures are drawn on. One figure, two files: SVG for papers and PNG for everything else, without a display.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::report {

struct Colour {
  std::uint8_t r = 0, g = 0, b = 0;
  double opacity = 1;
};

struct Spot {
  double x = 0, y = 0;  ///< points of 1/72 inch from the upper left corner
};

enum class Align { left, centre, right };

/// A small picture inside a figure: rows from the top, four bytes a pixel (red, green, blue, opacity).
struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgba;
};

class Canvas {
 public:
  virtual ~Canvas() = default;
  virtual void line(std::span<const Spot> spots, Colour colour, double width, bool dashed = false) = 0;
  /// Outlines filled by the even-odd rule.
  virtual void area(std::span<const std::vector<Spot>> outlines, Colour colour) = 0;
  /// @param at  where the baseline starts, is centred or ends; turned by 90 degrees against the clock when `upright` is
  /// false
  virtual void text(Spot at, std::string_view words, double size, Align align, Colour colour, bool upright = true) = 0;
  virtual void picture(Spot corner, double width, double height, const Picture& picture) = 0;
  /// The finished file.
  virtual std::string bytes() const = 0;

  void dot(Spot centre, double radius, Colour colour);
  void box(Spot corner, double width, double height, Colour colour);
};

std::unique_ptr<Canvas> svg_canvas(double width, double height);
/// @param scale  pixels a point
std::unique_ptr<Canvas> png_canvas(double width, double height, double scale = 2.5);

/// @throws Error when libpng cannot (out of memory)
std::string encode_png(const Picture& picture);

}  // namespace palpate::report
