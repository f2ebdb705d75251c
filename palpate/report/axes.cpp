// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/axes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::report {
namespace {

std::string tick_text(double value, double step) {
  const int decimals = std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 8);
  const std::string text = fmt::format("{:.{}f}", value, decimals);
  return text.find_first_not_of("-0.") == std::string::npos ? "0" : text;
}

}  // namespace

Colour category(std::size_t i, double opacity) {
  static constexpr std::array<Colour, 6> colours = {Colour{0, 114, 178}, {213, 94, 0},  {0, 158, 115},
                                                    {204, 121, 167},     {230, 159, 0}, {86, 180, 233}};
  Colour colour = colours[i % colours.size()];
  colour.opacity = opacity;
  return colour;
}

Range range_of(std::span<const double> values, bool with_zero) {
  double low = with_zero ? 0 : std::numeric_limits<double>::infinity(), high = with_zero ? 0 : -low;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (!(low <= high)) return {0, 1};
  if (low == high) {
    const double half = low == 0 ? 1 : 0.1 * std::abs(low);
    return {with_zero && low == 0 ? 0 : low - half, high + half};
  }
  const double margin = 0.06 * (high - low);
  return {with_zero && low == 0 ? 0 : low - margin, with_zero && high == 0 ? 0 : high + margin};
}

std::vector<double> round_ticks(Range range, int wanted) {
  const double raw = (range.to - range.from) / std::max(1, wanted);
  if (!(raw > 0)) return {range.from};
  const double power = std::pow(10, std::floor(std::log10(raw)));
  double step = 10 * power;
  for (const double m : {5.0, 2.0, 1.0}) {
    if (m * power >= raw * 0.999) step = m * power;
  }
  std::vector<double> ticks;
  for (double k = std::ceil(range.from / step - 1e-9); k * step <= range.to + 1e-9 * step; ++k) ticks.push_back(k * step);
  return ticks;
}

Axes::Axes(Canvas& canvas, double width, double height, const std::string& x_label, Range x, const std::string& y_label,
           Range y, double left_margin)
    : left(left_margin), right(width - 14), bottom(height - 34), canvas_(canvas), x_(x), y_(y) {
  const std::vector<double> xs = round_ticks(x_, static_cast<int>((right - left) / 55));
  for (const double tick : xs) {
    const std::array<Spot, 2> grid = {Spot{x_of(tick), top}, {x_of(tick), bottom}};
    canvas_.line(grid, rule, 0.6);
    canvas_.text({x_of(tick), bottom + 11}, tick_text(tick, xs.size() > 1 ? xs[1] - xs[0] : 1), 8, Align::centre, soft);
  }
  // Under the frame, but whole: a long one begins further left.
  constexpr double letter = 5.2;
  const double half = std::min(0.5 * letter * static_cast<double>(x_label.size()), width / 2);
  canvas_.text({std::clamp((left + right) / 2, half, width - half), height - 8}, x_label, 9, Align::centre, ink);
  if (!y_label.empty()) {
    const std::vector<double> ys = round_ticks(y_, static_cast<int>((bottom - top) / 32));
    for (const double tick : ys) {
      const std::array<Spot, 2> grid = {Spot{left, y_of(tick)}, {right, y_of(tick)}};
      canvas_.line(grid, rule, 0.6);
      canvas_.text({left - 5, y_of(tick) + 3}, tick_text(tick, ys.size() > 1 ? ys[1] - ys[0] : 1), 8, Align::right, soft);
    }
    canvas_.text({12, (top + bottom) / 2}, y_label, 9, Align::centre, ink, false);
  }
  const std::array<Spot, 2> frame = {Spot{left, bottom}, {right, bottom}};
  canvas_.line(frame, soft, 0.8);
}

void Axes::line(std::span<const Spot> values, Colour colour, double width, bool dashed) {
  std::vector<Spot> spots;
  for (const Spot& value : values) spots.push_back(at(value.x, value.y));
  canvas_.line(spots, colour, width, dashed);
}

}  // namespace palpate::report
