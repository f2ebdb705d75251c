// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/quantity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

struct Scaled {
  double factor;  ///< multiply by it to get the printed number
  std::string unit;
};

Scaled prefix_for(double magnitude, std::string_view unit) {
  if (unit == "Pa") {
    if (magnitude >= 1e9) return {1e-9, "GPa"};
    if (magnitude >= 1e6) return {1e-6, "MPa"};
    if (magnitude >= 1e3) return {1e-3, "kPa"};
    return {1, "Pa"};
  }
  if (unit == "m") {
    if (magnitude >= 1 || magnitude == 0) return {1, "m"};
    if (magnitude >= 1e-4) return {1e3, "mm"};
    return {1e6, "um"};
  }
  if (unit == "rad") return {180 / 3.14159265358979323846, "degrees"};
  if (unit == "1" || unit == "-") return {1, ""};
  return {1, std::string(unit)};
}

/// Decimals so that a step of `resolution` is still seen with one digit; three significant digits when it is 0.
int decimals_for(double magnitude, double resolution) {
  const double step =
      resolution > 0 ? resolution : (magnitude > 0 ? std::pow(10, std::floor(std::log10(magnitude)) - 2) : 0.01);
  return std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 8);
}

std::string number(double value, int decimals) {
  if (!std::isfinite(value)) return "unknown";
  const std::string text = fmt::format("{:.{}f}", value, decimals);
  return text.find_first_not_of("-0.") == std::string::npos && text.front() == '-' ? text.substr(1) : text;
}

std::string with_unit(const std::string& text, const std::string& unit) { return unit.empty() ? text : text + " " + unit; }

/// What so many decimals would print as nothing, or nearly so.
constexpr double smallest_with_decimals = 1e-6;
bool is_tiny(double printed) { return printed != 0 && std::abs(printed) < smallest_with_decimals; }

int magnitude_of(double value) { return static_cast<int>(std::floor(std::log10(std::abs(value)))); }

/// Of the lower end of a wide interval: two digits at least, in a unit of its own where that reads better.
std::string lower_end(double lower, const Scaled& scaled, std::string_view unit, int decimals) {
  const double printed = lower * scaled.factor;
  if (!(lower > 0) || magnitude_of(printed) + decimals >= 1) return number(printed, decimals);
  const Scaled own = prefix_for(lower, unit);
  const double alone = lower * own.factor;
  const std::string text = is_tiny(alone) ? fmt::format("{:.1e}", alone) : number(alone, std::max(0, 1 - magnitude_of(alone)));
  return own.unit == scaled.unit ? text : with_unit(text, own.unit);
}

}  // namespace

std::string quantity(double value, std::string_view unit, double resolution) {
  if (!std::isfinite(value)) return "unknown";
  const Scaled scaled = prefix_for(std::abs(value), unit);
  const double printed = value * scaled.factor;
  if (resolution == 0 && is_tiny(printed)) return with_unit(fmt::format("{:.2e}", printed), scaled.unit);
  return with_unit(number(printed, decimals_for(std::abs(printed), resolution * scaled.factor)), scaled.unit);
}

std::string interval(double lower, double upper, std::string_view unit) {
  if (!std::isfinite(lower) || !std::isfinite(upper)) return "unknown";
  const Scaled scaled = prefix_for(std::max(std::abs(lower), std::abs(upper)), unit);
  const double largest = std::max(std::abs(lower), std::abs(upper)) * scaled.factor;
  if (is_tiny(largest)) return with_unit(fmt::format("{:.2e} to {:.2e}", lower * scaled.factor, upper * scaled.factor), scaled.unit);
  const double width = std::abs(upper - lower) * scaled.factor;
  int decimals = decimals_for(std::abs(upper) * scaled.factor, width / 30);  // two digits of the half-width
  constexpr int most_digits = 5;
  if (largest > 0) decimals = std::clamp(most_digits - 1 - magnitude_of(largest), 0, decimals);
  // A thousandth of a millionth is no end of its own.
  const bool lower_counts = lower > 1e-9 * upper;
  return with_unit((lower_counts ? lower_end(lower, scaled, unit, decimals) : number(lower * scaled.factor, decimals)) + " to " +
                       number(upper * scaled.factor, decimals),
                   scaled.unit);
}

}  // namespace palpate
