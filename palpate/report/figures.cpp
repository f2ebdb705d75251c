// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "palpate/core/error.hpp"
#include "palpate/report/axes.hpp"
#include "palpate/report/figure_parts.hpp"
#include "palpate/report/object_picture.hpp"
#include "palpate/report/regions.hpp"
#include "palpate/report/words.hpp"

namespace palpate::report {
namespace {

using nlohmann::json;

Sheet object(Canvas* canvas, const json& page) {
  const Sheet sheet{column_pt, 290};
  const ObjectPicture drawn = draw_object(page, 850, 650);
  if (drawn.picture.width == 0) return {0, 0};
  if (canvas == nullptr) return sheet;
  canvas->picture({0, 0}, 340, 260, drawn.picture);
  const auto [factor, unit] = unit_for(drawn.largest_displacement_m, "m");
  for (int i = 0; i < 100; ++i) canvas->box({16 + 1.2 * i, 268}, 1.25, 7, size_colour(i / 99.0));
  canvas->text({16, 286}, "0", 8, Align::left, soft);
  canvas->text({136, 286}, fmt::format("{:.3g}", drawn.largest_displacement_m * factor), 8, Align::right, soft);
  canvas->text({144, 275}, fmt::format("displacement ({})", unit), 8, Align::left, ink);
  canvas->dot({248, 272}, 2, {217, 84, 0});
  canvas->text({254, 275}, "observed", 8, Align::left, ink);
  return sheet;
}

Sheet force_travel(Canvas* canvas, const json& page) {
  const json& steps = page["steps"];
  const bool travelled = std::any_of(steps.begin(), steps.end(), [](const json& s) { return s["travel_m"].is_number(); });
  const auto travel = [&](const json& s) { return number(s[travelled ? "travel_m" : "travel_predicted_m"]); };
  std::vector<double> travels, forces;
  for (const json& s : steps) {
    const double x = travel(s), measured = number(s["force_measured_n"]), predicted = number(s["force_predicted_n"]);
    if (!std::isfinite(x) || (!std::isfinite(measured) && !std::isfinite(predicted))) continue;
    travels.insert(travels.end(), {x, number(s["travel_predicted_m"])});
    const double spread = number(s["force_predicted_std_n"]);
    forces.insert(forces.end(), {measured, predicted, predicted + 1.96 * (std::isfinite(spread) ? spread : 0)});
  }
  if (travels.size() < 4) return {0, 0};
  const Sheet sheet{column_pt, 230};
  if (canvas == nullptr) return sheet;
  const Range reach = range_of(travels, true);
  const auto [factor, unit] = unit_for(std::max(std::abs(reach.from), std::abs(reach.to)), "m");
  Axes axes(*canvas, sheet.width, sheet.height,
            fmt::format("{} ({})", travelled ? "travel of the tool" : "simulated travel", unit),
            {reach.from * factor, reach.to * factor}, "force (N)", range_of(forces, true));
  std::vector<std::string> pushes;
  for (const json& s : steps) {
    if (std::find(pushes.begin(), pushes.end(), s["push"].get<std::string>()) == pushes.end()) pushes.push_back(s["push"]);
  }
  for (std::size_t p = 0; p < pushes.size(); ++p) {
    std::vector<json> own;
    for (const json& s : steps) {
      if (s["push"] == pushes[p] && std::isfinite(travel(s))) own.push_back(s);
    }
    std::sort(own.begin(), own.end(), [&](const json& a, const json& b) { return travel(a) < travel(b); });
    const bool imposed = std::all_of(own.begin(), own.end(), [](const json& s) {
      return !s["force_predicted_n"].is_number() || s["force_predicted_n"] == s["force_measured_n"];
    });
    std::vector<Spot> model, upper, lower;
    for (const json& s : own) {
      const double x = imposed ? number(s["travel_predicted_m"]) : travel(s);
      const double f = number(s[imposed ? "force_measured_n" : "force_predicted_n"]),
                   sd = number(s["force_predicted_std_n"]);
      if (!std::isfinite(x) || !std::isfinite(f)) continue;
      model.push_back({x * factor, f});
      if (!imposed && std::isfinite(sd)) {
        upper.push_back(axes.at(x * factor, f + 1.96 * sd));
        lower.push_back(axes.at(x * factor, f - 1.96 * sd));
      }
      const double sideways = 1.96 * number(s["travel_predicted_std_m"]);  // an imposed force is answered by a travel
      if (imposed && std::isfinite(sideways)) {
        upper.push_back(axes.at((x + sideways) * factor, f));
        lower.push_back(axes.at((x - sideways) * factor, f));
      }
    }
    if (upper.size() > 1) {
      upper.insert(upper.end(), lower.rbegin(), lower.rend());
      canvas->area(std::span(&upper, 1), category(p, 0.2));
    }
    axes.line(model, category(p), 1.3);
    for (const json& s : own) {
      const double f = number(s["force_measured_n"]);
      if (std::isfinite(f)) axes.dot(travel(s) * factor, f, 2.3, category(p));
    }
  }
  return sheet;
}

Sheet posterior(Canvas* canvas, const json& page) {
  const json& posterior = page["posterior"];
  if (!posterior.is_object()) return {0, 0};
  const auto young = posterior["young_modulus_pa"].get<std::vector<double>>();
  const auto poisson = posterior["poisson_ratio"].get<std::vector<double>>();
  const auto density = posterior["density"].get<Grid>();
  if (young.size() < 2 || poisson.size() < 2) return {0, 0};
  const Sheet sheet{column_pt, 260};
  if (canvas == nullptr) return sheet;
  std::vector<double> log_young;
  for (const double e : young) log_young.push_back(std::log(e));
  const auto [factor, unit] = unit_for(young.back(), "Pa");

  // Show what holds the probability: the box of the 99.9 % region.
  const auto wide = region_outlines(density, density_threshold(density, log_young, poisson, 0.999));
  std::vector<double> es, nus;
  for (const auto& outline : wide) {
    for (const Spot& s : outline) {
      es.push_back(std::exp(along(log_young, s.x)) * factor);
      nus.push_back(along(poisson, s.y));
    }
  }
  Axes axes(*canvas, sheet.width, sheet.height, fmt::format("Young's modulus ({})", unit), range_of(es, false),
            "Poisson ratio", range_of(nus, false));
  for (const double share : {0.95, 0.68}) {
    auto outlines = region_outlines(density, density_threshold(density, log_young, poisson, share));
    for (auto& outline : outlines) {
      for (Spot& s : outline) s = axes.at(std::exp(along(log_young, s.x)) * factor, along(poisson, s.y));
    }
    canvas->area(outlines, category(0, share > 0.9 ? 0.22 : 0.45));
  }
  for (const json& p : page["parameters"]) {
    if (p["name"] != "young_modulus" || !p["value"].is_number()) continue;
    for (const json& q : page["parameters"]) {
      if (q["name"] != "poisson_ratio" || !q["value"].is_number() || (q["region"] != "" && q["region"] != p["region"])) continue;
      const Spot at = axes.at(p["value"].get<double>() * factor, q["value"].get<double>());
      const std::array<Spot, 2> across = {Spot{at.x - 5, at.y}, {at.x + 5, at.y}},
                                down = {Spot{at.x, at.y - 5}, {at.x, at.y + 5}};
      canvas->line(across, ink, 1.4);
      canvas->line(down, ink, 1.4);
    }
  }
  return sheet;
}

Sheet residuals(Canvas* canvas, const json& page) {
  const json& h = page["histogram"];
  if (!h.is_object() || h["total"] == 0) return {0, 0};
  const Sheet sheet{column_pt, 210};
  if (canvas == nullptr) return sheet;
  const double from = h["from_m"], to = h["to_m"], total = h["total"];
  const auto counts = h["counts"].get<std::vector<double>>();
  const double bin = (to - from) / static_cast<double>(counts.size()), rms = number(page["fit"]["rms_m"]);
  const auto normal = [&](double r) {
    return total * bin * std::exp(-r * r / (2 * rms * rms)) / (rms * std::sqrt(2 * std::numbers::pi));
  };
  double top = *std::max_element(counts.begin(), counts.end());
  if (rms > 0) top = std::max(top, normal(0));
  const auto [factor, unit] = unit_for(to, "m");
  Axes axes(*canvas, sheet.width, sheet.height, fmt::format("residual ({})", unit), {from * factor, to * factor}, "points",
            {0, 1.08 * top});
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const Spot corner = axes.at((from + static_cast<double>(i) * bin) * factor, counts[i]);
    const double right = axes.x_of((from + static_cast<double>(i + 1) * bin) * factor);
    canvas->box({corner.x + 0.3, corner.y}, right - corner.x - 0.6, axes.bottom - corner.y, category(0, 0.55));
  }
  if (rms > 0) {
    std::vector<Spot> curve;
    for (int i = 0; i <= 100; ++i)
      curve.push_back({(from + (to - from) * i / 100) * factor, normal(from + (to - from) * i / 100)});
    axes.line(curve, ink, 1, true);
  }
  return sheet;
}

struct Row {
  const char* name;
  Draw draw;
};
/// The table of figures.
constexpr Row table[] = {
    {"object", object},       {"force_travel", force_travel}, {"posterior", posterior},
    {"residuals", residuals}, {"per_push", per_push},         {"per_site", per_site},
    {"budget", budget},       {"budget_if", budget_if},       {"held_out", held_out},
    {"convergence", convergence},
};

}  // namespace

std::vector<Figure> figures(const std::string& report_data) {
  std::vector<Figure> drawn;
  try {
    const json page = json::parse(report_data);
    if (page.at("format") != "palpate-report-1")
      throw Error("these data are of another version of palpate; run it again", "report");
    for (const Row& row : table) {
      const Sheet sheet = row.draw(nullptr, page);
      if (!(sheet.height > 0)) continue;
      const auto svg = svg_canvas(sheet.width, sheet.height), png = png_canvas(sheet.width, sheet.height);
      row.draw(svg.get(), page);
      row.draw(png.get(), page);
      drawn.push_back({row.name, svg->bytes(), png->bytes()});
    }
  } catch (const json::exception& problem) {
    throw Error(std::string("these are no data of a report: ") + problem.what(), "report");
  }
  return drawn;
}

std::vector<std::filesystem::path> write_figures(const std::string& report_data, const std::filesystem::path& folder) {
  std::error_code problem;
  std::filesystem::create_directories(folder, problem);
  if (problem) throw Error("cannot make this folder: " + problem.message(), folder.string());
  std::vector<std::filesystem::path> files;
  for (const Figure& figure : figures(report_data)) {
    for (const auto& [extension, bytes] : {std::pair{".svg", &figure.svg}, {".png", &figure.png}}) {
      files.push_back(folder / (figure.name + extension));
      std::ofstream file(files.back(), std::ios::binary);
      file << *bytes << std::flush;
      if (!file) throw Error("cannot write this file; is the disk full?", files.back().string());
    }
  }
  return files;
}

}  // namespace palpate::report
