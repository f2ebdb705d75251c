// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "palpate/report/axes.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

using report::Axes;
using report::Range;
using report::Spot;

constexpr double width_pt = 420, height_pt = 260;
const report::Colour truth_colour{22, 32, 44}, paper_colour = report::category(1), own_colour = report::category(0),
                     lowest_colour = report::category(2);

bool truth_known(const TrialAnswer& trial) { return std::isfinite(trial.young_modulus_pa); }

void legend(report::Canvas& canvas, const TrialAnswer& trial, const char* palpate, bool with_lowest = false) {
  std::vector<std::pair<const char*, report::Colour>> entries{{"paper's method", paper_colour}, {palpate, own_colour}};
  if (with_lowest) entries.push_back({"lowest of the grid", lowest_colour});
  if (truth_known(trial)) entries.insert(entries.begin(), {"truth", truth_colour});
  double x = 60, wide = 0;
  for (const auto& [words, colour] : entries) wide += 16 + 5.4 * static_cast<double>(std::string_view(words).size());
  canvas.box({x - 6, 4}, wide, 15, {255, 255, 255});
  for (const auto& [words, colour] : entries) {
    canvas.dot({x, 12}, 3, colour);
    canvas.text({x + 7, 15}, words, 9, report::Align::left, report::ink);
    x += 16 + 5.4 * static_cast<double>(std::string_view(words).size());
  }
}

}  // namespace

std::string surface_figure(const TrialAnswer& trial) {
  const ErrorSurface& surface = trial.surface;
  if (surface.error_m2.cols() < 2) return {};
  auto canvas = report::svg_canvas(width_pt, height_pt);
  const Index rows = static_cast<Index>(surface.error_m2.rows()), columns = static_cast<Index>(surface.error_m2.cols());
  Axes axes(*canvas, width_pt, height_pt, "log10 E (Pa)",
            {std::log10(surface.young_modulus_pa(0)), std::log10(surface.young_modulus_pa(rows - 1))}, "Poisson ratio",
            {std::min(0.0, surface.poisson_ratio(0)), std::max(0.5, surface.poisson_ratio(columns - 1))});  // where searches may go
  const double low = std::log(surface.smallest_m2());
  double high = low;
  for (double e : surface.error_m2.reshaped())
    if (std::isfinite(e)) high = std::max(high, std::log(e));
  const auto x_at = [&](double i) {
    const double a = std::log10(surface.young_modulus_pa(0)), b = std::log10(surface.young_modulus_pa(rows - 1));
    return std::clamp(a + (b - a) * i / static_cast<double>(rows - 1), a, b);
  };
  const auto y_at = [&](double k) {
    const double a = surface.poisson_ratio(0), b = surface.poisson_ratio(columns - 1);
    return std::clamp(a + (b - a) * k / static_cast<double>(columns - 1), a, b);
  };
  for (Index i = 0; i < rows; ++i)
    for (Index k = 0; k < columns; ++k) {
      const double e = surface.error_m2(i, k);
      const double share = std::isfinite(e) && high > low ? (std::log(e) - low) / (high - low) : 1;
      const auto tone = [&](double from, double to) { return static_cast<std::uint8_t>(from + (to - from) * share); };
      const Spot corner = axes.at(x_at(static_cast<double>(i) - 0.5), y_at(static_cast<double>(k) + 0.5)),
                 opposite = axes.at(x_at(static_cast<double>(i) + 0.5), y_at(static_cast<double>(k) - 0.5));
      canvas->box(corner, opposite.x - corner.x + 0.3, opposite.y - corner.y + 0.3, {tone(40, 245), tone(90, 246), tone(140, 248)});
    }
  const auto path = [&](const MethodAnswer& method, report::Colour colour) {
    std::vector<Spot> spots;  // as long as it is in the picture
    const auto draw = [&] {
      if (spots.size() > 1) axes.line(spots, colour, 1.4);
      spots.clear();
    };
    for (const FitIteration& at : method.path) {
      const double x = std::log10(at.young_modulus_pa), y = at.poisson_ratio;
      if (x >= x_at(0) && x <= x_at(static_cast<double>(rows)) && y >= 0 && y <= 0.5) {
        spots.push_back({x, y});
        if (&at == &method.path.front()) axes.dot(x, y, 2, colour);
      } else {
        draw();
      }
    }
    draw();
    axes.dot(std::log10(method.young_modulus_pa), method.poisson_ratio, 4, colour);
  };
  Eigen::Index lowest_row = 0, lowest_column = 0;
  surface.error_m2.minCoeff(&lowest_row, &lowest_column);
  axes.dot(x_at(static_cast<double>(lowest_row)), y_at(static_cast<double>(lowest_column)), 7, {255, 255, 255});
  axes.dot(x_at(static_cast<double>(lowest_row)), y_at(static_cast<double>(lowest_column)), 5.5, lowest_colour);
  for (const StartAnswer& from : trial.starts) {
    path(from.paper, paper_colour);
    path(from.palpate, own_colour);
  }
  path(trial.paper, paper_colour);
  path(trial.palpate, own_colour);
  if (truth_known(trial)) axes.dot(std::log10(trial.young_modulus_pa), trial.poisson_ratio, 3, truth_colour);
  legend(*canvas, trial, "palpate", true);
  return canvas->bytes();
}

std::string error_figure(const TrialAnswer& trial) {
  const ErrorSurface& surface = trial.surface;
  if (surface.error_m2.rows() < 2) return {};
  Eigen::Index nearest = 0;
  (surface.poisson_ratio.array() - trial.paper.poisson_ratio).abs().minCoeff(&nearest);
  std::vector<Spot> spots;
  std::vector<double> roots;
  for (Eigen::Index i = 0; i < surface.error_m2.rows(); ++i) {
    const double root_mm = 1000 * std::sqrt(surface.error_m2(i, nearest));
    if (!std::isfinite(root_mm)) continue;
    spots.push_back({surface.young_modulus_pa(i) / 1000, root_mm});
    roots.push_back(root_mm);
  }
  if (spots.size() < 2) return {};
  auto canvas = report::svg_canvas(width_pt, height_pt);
  const Range range = report::range_of(roots, false);
  Axes axes(*canvas, width_pt, height_pt, "E (kPa)", {spots.front().x, spots.back().x}, "root of the error function (mm)", range);
  axes.line(spots, paper_colour, 1.4);
  for (const Spot& spot : spots) axes.dot(spot.x, spot.y, 2.2, paper_colour);
  const Spot& lowest = *std::min_element(spots.begin(), spots.end(), [](const Spot& a, const Spot& b) { return a.y < b.y; });
  axes.dot(lowest.x, lowest.y, 4.5, lowest_colour);
  const auto upright = [&](double young_pa, report::Colour colour, bool dashed) {
    const double x = young_pa / 1000;
    if (x >= spots.front().x && x <= spots.back().x) axes.line(std::vector<Spot>{{x, range.from}, {x, range.to}}, colour, 1, dashed);
  };
  if (truth_known(trial)) upright(trial.young_modulus_pa, truth_colour, true);
  upright(trial.paper.young_modulus_pa, paper_colour, false);
  upright(trial.palpate.young_modulus_pa, own_colour, false);
  legend(*canvas, trial, "palpate", true);
  return canvas->bytes();
}

std::string force_figure(const TrialAnswer& trial) {
  std::map<std::string, std::vector<Spot>> pushes;
  std::vector<double> travels, forces;
  for (const ForceReading& reading : trial.readings) {
    if (!std::isfinite(reading.travel_m)) continue;
    pushes[reading.push].push_back({1000 * reading.travel_m, reading.force_n});
    travels.push_back(1000 * reading.travel_m);
    forces.push_back(reading.force_n);
  }
  if (travels.size() < 2) return {};
  auto canvas = report::svg_canvas(width_pt, height_pt);
  Axes axes(*canvas, width_pt, height_pt, "travel of the tool (mm)", report::range_of(travels, true), "force (N)",
            report::range_of(forces, true));
  std::size_t i = 0;
  double x = 60;
  for (const auto& [name, spots] : pushes) {
    const auto colour = report::category(i++);
    axes.line(spots, colour, 1.4);
    for (const Spot& spot : spots) axes.dot(spot.x, spot.y, 2.5, colour);
    canvas->dot({x, 12}, 3, colour);
    canvas->text({x + 7, 15}, name, 9, report::Align::left, report::ink);
    x += 24 + 5.4 * static_cast<double>(name.size());
  }
  return canvas->bytes();
}

std::string samples_figure(const TrialAnswer& trial) {
  if (trial.samples.empty()) return {};
  std::vector<double> values;
  const auto joint = [&](const MethodAnswer& answer) {
    if (std::isfinite(answer.young_modulus_pa)) values.push_back(answer.young_modulus_pa / 1000);
  };
  joint(trial.paper);
  joint(trial.palpate);
  if (truth_known(trial)) values.push_back(trial.young_modulus_pa / 1000);
  for (const SiteAnswer& site : trial.sites) {
    values.push_back(site.young_modulus_pa / 1000);
    joint(site.paper);
    joint(site.palpate);
  }
  if (values.empty()) return {};
  const double most_kpa = 4 * *std::max_element(values.begin(), values.end());  // a sample that says nothing must not hide the others
  for (const SampleAnswer& sample : trial.samples)
    for (double e : {sample.paper.young_modulus_pa, sample.palpate.young_modulus_pa})
      if (e / 1000 < most_kpa) values.push_back(e / 1000);
  auto canvas = report::svg_canvas(width_pt, height_pt);
  const double count = static_cast<double>(trial.samples.size());
  const Range range = report::range_of(values, true);
  Axes axes(*canvas, width_pt, height_pt, "sample, all pushes one after the other", {0, count + 1}, "E (kPa)", range);
  const auto level = [&](double from, double to, double young_pa, report::Colour colour, bool dashed) {
    if (std::isfinite(young_pa) && young_pa / 1000 < range.to)
      axes.line(std::vector<Spot>{{from, young_pa / 1000}, {to, young_pa / 1000}}, colour, 1, dashed);
  };
  const auto levels = [&](double from, double to, double truth_pa, const MethodAnswer& paper, const MethodAnswer& palpate) {
    if (truth_known(trial)) level(from, to, truth_pa, truth_colour, true);
    level(from, to, paper.young_modulus_pa, paper_colour, false);
    level(from, to, palpate.young_modulus_pa, own_colour, false);
  };
  if (trial.sites.empty()) levels(0, count + 1, trial.young_modulus_pa, trial.paper, trial.palpate);
  // Each push is of a site of its own.
  std::size_t place = 0;
  for (std::size_t from = 0, to = 0; from < trial.samples.size() && place < trial.sites.size(); from = to, ++place) {
    for (to = from; to < trial.samples.size() && trial.samples[to].push == trial.samples[from].push;) ++to;
    const SiteAnswer& site = trial.sites[place];
    levels(static_cast<double>(from) + 0.5, static_cast<double>(to) + 0.5, site.young_modulus_pa, site.paper, site.palpate);
    const Spot foot = axes.at(0.5 * static_cast<double>(from + to) + 0.5, range.from);
    canvas->text({foot.x, foot.y - 5}, site.site, 9, report::Align::centre, report::soft);
  }
  for (std::size_t i = 0; i < trial.samples.size(); ++i) {
    const SampleAnswer& sample = trial.samples[i];
    const double x = static_cast<double>(i) + 1;
    if (i > 0 && trial.samples[i - 1].push != sample.push)
      axes.line(std::vector<Spot>{{x - 0.5, range.from}, {x - 0.5, range.to}}, report::rule, 0.8);
    const double top = std::min(sample.palpate.upper_95_pa / 1000, range.to), foot = sample.palpate.lower_95_pa / 1000;
    if (foot < top) axes.line(std::vector<Spot>{{x + 0.12, foot}, {x + 0.12, top}}, own_colour, 1);
    if (sample.palpate.young_modulus_pa / 1000 < range.to) axes.dot(x + 0.12, sample.palpate.young_modulus_pa / 1000, 2.5, own_colour);
    if (sample.paper.young_modulus_pa / 1000 < range.to) axes.dot(x - 0.12, sample.paper.young_modulus_pa / 1000, 2.5, paper_colour);
  }
  legend(*canvas, trial, "palpate, 95 %");
  return canvas->bytes();
}

namespace {

/// Where the pictures differ most, with as much around it; of surfaces that cannot be compared, all.
std::pair<Vec3, Vec3> differing_part(const std::vector<RegistrationPicture>& pictures) {
  const Points& first = pictures.front().simulated_m;
  const Points& last = pictures.back().simulated_m;
  Vec3 low = first.colwise().minCoeff(), high = first.colwise().maxCoeff();
  if (first.rows() != last.rows()) return {low, high};
  const VectorX moved_m = (first - last).rowwise().norm();
  Vec3 from = high, to = low;
  for (Index i = 0; i < static_cast<Index>(first.rows()); ++i) {
    if (!(moved_m(i) > 0.6 * moved_m.maxCoeff())) continue;
    const Vec3 at = first.row(i);
    from = from.cwiseMin(at), to = to.cwiseMax(at);
  }
  if ((to - from).minCoeff() < 0) return {low, high};
  const Vec3 half = Vec3::Constant(std::max((to - from).maxCoeff(), 0.15 * (high - low).maxCoeff()));
  const Vec3 middle = 0.5 * (from + to);
  return {low.cwiseMax(middle - half), high.cwiseMin(middle + half)};
}

}  // namespace

std::string registration_figure(const TrialAnswer& trial) {
  if (trial.pictures.empty()) return {};
  constexpr double side_pt = 210, rows_pt = 190;
  const auto [low, high] = differing_part(trial.pictures);
  // Along the object's longer horizontal side, and upwards.
  const int across = high.x() - low.x() > high.y() - low.y() ? 0 : 1;
  const double scale = std::min((side_pt - 20) / (high(across) - low(across)), (rows_pt - 40) / (high.z() - low.z()));
  const std::size_t lines = (trial.pictures.size() + 1) / 2;
  auto canvas = report::svg_canvas(2 * side_pt, rows_pt * static_cast<double>(lines));
  for (std::size_t k = 0; k < trial.pictures.size(); ++k) {
    const RegistrationPicture& picture = trial.pictures[k];
    const double left = 10 + side_pt * static_cast<double>(k % 2), foot = rows_pt * static_cast<double>(k / 2 + 1) - 14;
    const auto dots = [&](const Points& points_m, double radius, report::Colour colour) {
      for (Index i = 0; i < static_cast<Index>(points_m.rows()); ++i) {
        const double x_m = points_m(i, across), z_m = points_m(i, 2);
        if ((points_m.row(i).transpose().array() < low.array()).any() || (points_m.row(i).transpose().array() > high.array()).any()) continue;
        canvas->dot({left + scale * (x_m - low(across)), foot - scale * (z_m - low.z())}, radius, colour);
      }
    };
    dots(picture.simulated_m, 1.6, report::faint);
    dots(picture.registered_m, 1.1, paper_colour);
    canvas->text({left, foot - rows_pt + 28},
                 "E = " + report::quantity(picture.young_modulus_pa, "Pa") + ", rms " + fmt::format("{:.2f} mm", 1000 * picture.rms_m), 9,
                 report::Align::left, report::ink);
  }
  return canvas->bytes();
}

}  // namespace palpate::cli
