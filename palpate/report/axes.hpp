// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "palpate/report/canvas.hpp"

namespace palpate::report {

inline constexpr Colour ink{22, 32, 44}, soft{85, 96, 110}, faint{163, 172, 184}, rule{223, 227, 232};
/// Okabe and Ito's colours, which colour-blind eyes keep apart.
Colour category(std::size_t i, double opacity = 1);

struct Range {
  double from = 0, to = 1;
};

/// From the smallest to the largest finite value with a margin, never empty.
Range range_of(std::span<const double> values, bool with_zero);

/// Round numbers that cut the range into about `wanted` parts.
std::vector<double> round_ticks(Range range, int wanted);

/// A frame with ticks. Without a y label there are no y ticks: rows with names take their place.
class Axes {
 public:
  Axes(Canvas& canvas, double width, double height, const std::string& x_label, Range x, const std::string& y_label, Range y,
       double left = 46);

  Spot at(double x, double y) const { return {x_of(x), y_of(y)}; }
  double x_of(double x) const { return left + (right - left) * (x - x_.from) / (x_.to - x_.from); }
  double y_of(double y) const { return bottom - (bottom - top) * (y - y_.from) / (y_.to - y_.from); }
  void line(std::span<const Spot> values, Colour colour, double width, bool dashed = false);
  void dot(double x, double y, double radius, Colour colour) { canvas_.dot(at(x, y), radius, colour); }

  double left, right, top = 10, bottom;

 private:
  Canvas& canvas_;
  Range x_, y_;
};

}  // namespace palpate::report
