// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace palpate::report {
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

}  // namespace

std::string quantity(double value, std::string_view unit, double resolution) {
  if (!std::isfinite(value)) return "unknown";
  const Scaled scaled = prefix_for(std::abs(value), unit);
  const double printed = value * scaled.factor;
  return with_unit(number(printed, decimals_for(std::abs(printed), resolution * scaled.factor)), scaled.unit);
}

std::string interval(double lower, double upper, std::string_view unit) {
  if (!std::isfinite(lower) || !std::isfinite(upper)) return "unknown";
  const Scaled scaled = prefix_for(std::max(std::abs(lower), std::abs(upper)), unit);
  const double width = std::abs(upper - lower) * scaled.factor;
  const int decimals = decimals_for(std::abs(upper) * scaled.factor, width / 30);  // two digits of the half-width
  return with_unit(number(lower * scaled.factor, decimals) + " to " + number(upper * scaled.factor, decimals), scaled.unit);
}

std::string parameter_title(const Parameter& parameter) {
  std::string title = parameter.name;
  if (parameter.name == "young_modulus") {
    title = "Young's modulus";
  } else if (parameter.name == "poisson_ratio") {
    title = "Poisson ratio";
  } else {
    std::replace(title.begin(), title.end(), '_', ' ');
  }
  return parameter.region.empty() ? title : title + " (" + parameter.region + ")";
}

std::string termination_words(Termination termination) {
  switch (termination) {
    case Termination::converged:
      return "converged";
    case Termination::max_iterations:
      return "stopped at the iteration limit";
    case Termination::cancelled:
      return "stopped by the user";
    case Termination::no_progress:
      return "stopped without further progress";
    case Termination::failed:
      break;
  }
  return "failed";
}

std::string answer_so_far(const Identification& identification) {
  std::string text;
  for (const Parameter& parameter : identification.parameters) {
    if (!text.empty()) text += ", ";
    const bool bounded = std::isfinite(parameter.lower_95) && std::isfinite(parameter.upper_95);
    const double resolution = bounded ? (parameter.upper_95 - parameter.lower_95) / 30 : 0;
    text += parameter_title(parameter) + " " + quantity(parameter.value, parameter.unit, resolution);
    if (bounded) text += " (95 % interval " + interval(parameter.lower_95, parameter.upper_95, parameter.unit) + ")";
  }
  return text.empty() ? "There is no estimate yet." : "So far: " + text + ".";
}

std::string answer(const Identification& identification) {
  if (identification.parameters.empty()) {
    return "There is no answer: the fit " + termination_words(identification.termination) + ". " + identification.message;
  }
  std::string text;
  for (const Parameter& parameter : identification.parameters) {
    const std::string range = interval(parameter.lower_95, parameter.upper_95, parameter.unit);
    const bool article = parameter.name != "young_modulus";
    const std::string title = article ? "The " + parameter_title(parameter) : parameter_title(parameter);
    if (!text.empty()) text += ' ';
    if (!std::isfinite(parameter.lower_95) || !std::isfinite(parameter.upper_95)) {
      text += fmt::format("{} is {} (without an interval).", title, quantity(parameter.value, parameter.unit));
    } else if (parameter.determined) {
      const double resolution = (parameter.upper_95 - parameter.lower_95) / 30;
      text +=
          fmt::format("{} is {} (95 % interval {}).", title, quantity(parameter.value, parameter.unit, resolution), range);
    } else {
      text += fmt::format("{} is not determined by these pushes: it may be anything from {}.", title, range);
    }
  }
  if (identification.termination != Termination::converged) {
    text += " Take this with care: the fit " + termination_words(identification.termination) + ".";
  }
  return text;
}

}  // namespace palpate::report
