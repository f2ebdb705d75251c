// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace palpate::report {

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
    } else if (parameter.lower_95 == parameter.upper_95) {
      text += fmt::format("{} was given as {}.", title, quantity(parameter.value, parameter.unit));
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
