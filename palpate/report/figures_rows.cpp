// SPDX-License-Identifier: Apache-2.0
// Figures of rows: parts of a recording, error budget, held-out prediction; and the path of the fit.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <tuple>

#include "palpate/report/axes.hpp"
#include "palpate/report/figure_parts.hpp"

namespace palpate::report {
namespace {

using nlohmann::json;

/// Width of what begins at a byte, over the size of the letters; continuation bytes of UTF-8 have none.
double em(char letter) {
  constexpr std::string_view narrow = "iljtfrI1.,:;'|!()[] ", wide = "mwMWQOG@%";
  if ((static_cast<unsigned char>(letter) & 0xC0) == 0x80) return 0;
  return narrow.find(letter) != narrow.npos ? 0.38 : wide.find(letter) != wide.npos ? 0.85 : 0.62;
}

double em(std::string_view text) {
  double sum = 0;
  for (const char letter : text) sum += em(letter);
  return sum;
}

/// As much of the beginning as there is room for, by whole letters; nothing is left out of what fits.
std::string shortened(std::string_view text, double room_em = 13.2) {
  if (em(text) <= room_em) return std::string(text);
  // Of "input, region" the region tells the rows apart.
  const std::size_t comma = text.rfind(", ");
  if (comma != text.npos && em(text.substr(comma)) < 0.6 * room_em)
    return shortened(text.substr(0, comma), room_em - em(text.substr(comma))) + std::string(text.substr(comma));
  constexpr std::string_view dots = "...";
  std::size_t end = 0;
  double sum = em(dots);
  while (end < text.size() && sum + em(text[end]) <= room_em) sum += em(text[end++]);
  // A letter whose first byte has no room takes its other bytes with it: they stand behind `end`.
  return std::string(text.substr(0, end)) + std::string(dots);
}

Sheet young_of_parts(Canvas* canvas, const json& list, std::size_t colour) {
  if (list.size() < 2) return {0, 0};
  const Sheet sheet{column_pt, 46 + 15.0 * static_cast<double>(list.size())};
  if (canvas == nullptr) return sheet;
  std::vector<double> ends;
  for (const json& p : list) ends.insert(ends.end(), {number(p["lower_95"]), number(p["upper_95"]), number(p["value"])});
  const Range reach = range_of(ends, false);
  const auto [factor, unit] = unit_for(std::abs(reach.to), "Pa");
  Axes axes(*canvas, sheet.width, sheet.height, fmt::format("Young's modulus ({})", unit),
            {reach.from * factor, reach.to * factor}, "", {0, 1}, 110);
  double y = axes.top + 7;
  for (const json& p : list) {
    if (!p["value"].is_number()) continue;
    canvas->text({104, y + 3}, shortened(p["region"].get<std::string>()), 8, Align::right, soft);
    const std::array<Spot, 2> bar = {Spot{axes.x_of(number(p["lower_95"]) * factor), y},
                                     {axes.x_of(number(p["upper_95"]) * factor), y}};
    canvas->line(bar, category(colour, 0.5), 1.8);
    canvas->dot({axes.x_of(number(p["value"]) * factor), y}, 2.8, category(colour));
    y += 15;
  }
  return sheet;
}

Sheet bars(Canvas* canvas, const std::vector<std::tuple<std::string, double, std::string>>& rows, const std::string& label) {
  const Sheet sheet{column_pt, 46 + 18.0 * static_cast<double>(rows.size())};
  if (canvas == nullptr || rows.empty()) return rows.empty() ? Sheet{0, 0} : sheet;
  double largest = 0;
  for (const auto& row : rows) largest = std::max(largest, std::get<1>(row));
  Axes axes(*canvas, sheet.width, sheet.height, label, {0, largest > 0 ? 1.3 * largest : 1}, "", {0, 1}, 118);
  double y = axes.top + 3;
  for (const auto& [name, value, text] : rows) {
    canvas->text({112, y + 9}, shortened(name), 8, Align::right, soft);
    canvas->box({axes.left, y}, std::max(0.5, axes.x_of(value) - axes.left), 12, category(0));
    canvas->text({axes.x_of(value) + 4, y + 9}, text, 8, Align::left, ink);
    y += 18;
  }
  return sheet;
}

/// A bar an input, and where there are several regions one for each of them.
Sheet shares(Canvas* canvas, const json& budget, const std::string& label) {
  std::vector<std::tuple<std::string, double, std::string>> rows;
  const auto add = [&](const std::string& name, const json& of_young) {
    const double percent = std::abs(number(of_young));
    if (std::isfinite(percent)) rows.emplace_back(name, percent, fmt::format("{:.2g} %", percent));
  };
  for (const json& b : budget) {
    if (b["regions"].empty()) add(b["input"], b["young_modulus_percent"]);
    for (const json& one : b["regions"]) add(b["input"].get<std::string>() + ", " + one["region"].get<std::string>(), one["young_modulus_percent"]);
  }
  std::sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return std::get<1>(a) > std::get<1>(b); });
  return bars(canvas, rows, label);
}

}  // namespace

Sheet per_push(Canvas* canvas, const json& page) { return young_of_parts(canvas, page["per_push"], 0); }

Sheet per_site(Canvas* canvas, const json& page) {
  const auto in_pushes = [&](const json& site) {
    return std::any_of(page["per_push"].begin(), page["per_push"].end(), [&](const json& push) { return push["value"] == site["value"]; });
  };
  const json& sites = page["per_site"];
  // Where every site was pushed once, the pushes have said it all.
  return std::all_of(sites.begin(), sites.end(), in_pushes) ? Sheet{0, 0} : young_of_parts(canvas, sites, 3);
}

Sheet budget(Canvas* canvas, const json& page) { return shares(canvas, page["budget"], "share of Young's modulus (%)"); }

Sheet budget_if(Canvas* canvas, const json& page) {
  return shares(canvas, page["budget_if"], "Young's modulus, were the input off (%)");
}

Sheet held_out(Canvas* canvas, const json& page) {
  const json& p = page["prediction"];
  std::vector<std::tuple<std::string, double, std::string>> rows;
  if (p["available"] != true || !p["surface_rms_m"].is_number()) return {0, 0};
  for (const auto& [name, key] : {std::pair{"the fit that has seen it", "fitted_rms_m"},
                                  {"prediction", "surface_rms_m"},
                                  {"as at the last step", "baseline_last_step_rms_m"},
                                  {"no deformation", "baseline_no_deformation_rms_m"}}) {
    if (p[key].is_number()) rows.emplace_back(name, p[key].get<double>() * 1e3, quantity(p[key], "m"));
  }
  return bars(canvas, rows, "rms distance to the surface that was seen (mm)");
}

Sheet convergence(Canvas* canvas, const json& page) {
  std::vector<double> young, cost;
  std::vector<int> round;
  for (const json& at : page["trace"]) {
    if (!at["young_modulus_pa"].is_number() || !at["cost"].is_number()) continue;
    young.push_back(at["young_modulus_pa"]);
    cost.push_back(at["cost"]);
    round.push_back(at["round"]);
  }
  if (young.size() < 2) return {0, 0};
  const Sheet sheet{column_pt, 190};
  if (canvas == nullptr) return sheet;
  const auto [factor, unit] = unit_for(*std::max_element(young.begin(), young.end()), "Pa");
  for (double& e : young) e *= factor;
  Axes axes(*canvas, sheet.width, sheet.height, "iteration", {0, static_cast<double>(young.size() - 1)},
            fmt::format("Young's modulus ({})", unit), range_of(young, false));
  const auto [low, high] = std::minmax_element(cost.begin(), cost.end());
  // Dashed: the cost on a logarithmic scale of its own, over the same height; a round's cost starts afresh.
  std::vector<Spot> stretch;
  for (std::size_t i = 0; *low > 0 && *high > *low && i < cost.size(); ++i) {
    if (i > 0 && round[i] != round[i - 1]) stretch.clear();
    const double share = 0.04 + 0.92 * std::log(cost[i] / *low) / std::log(*high / *low);
    stretch.push_back({axes.x_of(static_cast<double>(i)), axes.bottom - (axes.bottom - axes.top) * share});
    if (stretch.size() > 1) canvas->line(std::span(stretch).last(2), faint, 1, true);
  }
  std::vector<Spot> path;
  for (std::size_t i = 0; i < young.size(); ++i) path.push_back({static_cast<double>(i), young[i]});
  axes.line(path, category(0), 1.3);
  for (const Spot& at : path) axes.dot(at.x, at.y, 2.2, category(0));
  return sheet;
}

}  // namespace palpate::report
