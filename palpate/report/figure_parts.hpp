// SPDX-License-Identifier: Apache-2.0
// What the figures share. Not for other files than figures*.cpp.
#pragma once

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "palpate/report/canvas.hpp"
#include "palpate/report/words.hpp"

namespace palpate::report {

inline constexpr double column_pt = 340;  // a column of a paper, a little wider

inline double number(const nlohmann::json& value) { return value.is_number() ? value.get<double>() : std::nan(""); }

/// Factor and name of the unit that suits the largest value, as `quantity` chooses it.
inline std::pair<double, std::string> unit_for(double largest, const std::string& unit) {
  const std::string text = quantity(largest, unit);
  const std::size_t space = text.find(' ');
  const std::string name = space == std::string::npos ? "" : text.substr(space + 1);
  if (name == "mm") return {1e3, name};
  if (name == "um") return {1e6, name};
  if (name == "kPa") return {1e-3, name};
  if (name == "MPa") return {1e-6, name};
  if (name == "GPa") return {1e-9, name};
  return {1, unit};
}

struct Sheet {
  double width, height;
};
/// Says how large the figure is, or draws it when a canvas is given. Nothing to draw: height 0.
using Draw = Sheet (*)(Canvas*, const nlohmann::json&);

Sheet per_push(Canvas* canvas, const nlohmann::json& page);
Sheet per_site(Canvas* canvas, const nlohmann::json& page);
Sheet budget(Canvas* canvas, const nlohmann::json& page);
Sheet budget_if(Canvas* canvas, const nlohmann::json& page);
Sheet held_out(Canvas* canvas, const nlohmann::json& page);
Sheet convergence(Canvas* canvas, const nlohmann::json& page);

}  // namespace palpate::report
