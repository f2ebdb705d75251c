// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "palpate/core/version.hpp"
#include "palpate/report/axes.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

using report::Axes;
using report::Range;
using report::Spot;

constexpr double width_pt = 420, height_pt = 260;
const report::Colour truth_colour{22, 32, 44}, paper_colour = report::category(1), own_colour = report::category(0);

void legend(report::Canvas& canvas, std::initializer_list<std::pair<const char*, report::Colour>> entries) {
  double x = 60;
  for (const auto& [words, colour] : entries) {
    canvas.dot({x, 12}, 3, colour);
    canvas.text({x + 7, 15}, words, 9, report::Align::left, report::ink);
    x += 16 + 5.4 * static_cast<double>(std::string_view(words).size());
  }
}

/// Fig. 4: the error over (E, nu), both paths on it.
std::string surface_figure(const TrialAnswer& trial) {
  const ErrorSurface& surface = trial.surface;
  if (surface.error_m2.size() == 0) return {};
  auto canvas = report::svg_canvas(width_pt, height_pt);
  const Index rows = static_cast<Index>(surface.error_m2.rows()), columns = static_cast<Index>(surface.error_m2.cols());
  Axes axes(*canvas, width_pt, height_pt, "log10 E (Pa)",
            {std::log10(surface.young_modulus_pa(0)), std::log10(surface.young_modulus_pa(rows - 1))}, "Poisson ratio",
            {surface.poisson_ratio(0), surface.poisson_ratio(columns - 1)});
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
    std::vector<Spot> spots;
    for (const FitIteration& at : method.path) {
      const double x = std::log10(at.young_modulus_pa), y = at.poisson_ratio;
      if (x < x_at(0) || x > x_at(static_cast<double>(rows)) || y < y_at(0) || y > y_at(static_cast<double>(columns))) continue;
      spots.push_back({x, y});
    }
    if (spots.size() > 1) axes.line(spots, colour, 1.4);
    axes.dot(std::log10(method.young_modulus_pa), method.poisson_ratio, 4, colour);
  };
  path(trial.paper, paper_colour);
  path(trial.palpate, own_colour);
  axes.dot(std::log10(trial.young_modulus_pa), trial.poisson_ratio, 3, truth_colour);
  legend(*canvas, {{"truth", truth_colour}, {"paper's method", paper_colour}, {"palpate", own_colour}});
  return canvas->bytes();
}

/// Fig. 5: measured force over travel.
std::string force_figure(const TrialAnswer& trial) {
  std::map<std::string, std::vector<Spot>> pushes;
  std::vector<double> travels, forces;
  for (const SampleAnswer& sample : trial.samples) {
    if (!std::isfinite(sample.travel_m)) continue;
    pushes[sample.push].push_back({1000 * sample.travel_m, sample.force_n});
    travels.push_back(1000 * sample.travel_m);
    forces.push_back(sample.force_n);
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

/// Fig. 6, 8 and 9: E of every sample alone, by both methods, with ours' interval.
std::string samples_figure(const TrialAnswer& trial) {
  if (trial.samples.empty()) return {};
  std::vector<double> values{trial.young_modulus_pa / 1000};
  for (const SampleAnswer& sample : trial.samples)
    for (double e : {sample.paper.young_modulus_pa, sample.palpate.young_modulus_pa})
      if (e < 6 * trial.young_modulus_pa) values.push_back(e / 1000);
  auto canvas = report::svg_canvas(width_pt, height_pt);
  const double count = static_cast<double>(trial.samples.size());
  const Range range = report::range_of(values, true);
  Axes axes(*canvas, width_pt, height_pt, "sample, all pushes one after the other", {0, count + 1}, "E (kPa)", range);
  axes.line(std::vector<Spot>{{0.0, trial.young_modulus_pa / 1000}, {count + 1, trial.young_modulus_pa / 1000}}, truth_colour, 1, true);
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
  legend(*canvas, {{"truth", truth_colour}, {"paper's method", paper_colour}, {"palpate, 95 %", own_colour}});
  return canvas->bytes();
}

std::string figure(const std::string& svg, const std::string& caption) {
  return svg.empty() ? std::string() : "<figure>" + svg + "<figcaption>" + caption + "</figcaption></figure>\n";
}

std::string row(const std::string& method, const Score& score, bool interval) {
  return fmt::format(
      "<tr><td>{}</td><td>{:+.1f} %</td><td>{:.1f} %</td><td>{:+.3f}</td><td>{:.3f}</td><td>{}</td><td>{:.0f}</td><td>{:.1f}</td></tr>\n",
      method, score.bias_percent, score.rms_percent, score.poisson_bias, score.poisson_rms,
      interval ? fmt::format("{} of {}", score.inside_95, score.with_interval) : "none", score.solves, score.seconds);
}

std::string section(const SceneAnswers& answers) {
  const lab::PaperScene& scene = *answers.scene;
  const TrialAnswer& first = answers.trials.front();
  std::string html = fmt::format("<h2 id=\"{}\">{}</h2>\n<p><b>The paper</b> (fig. {}): {}<br><b>Here</b>: {}</p>\n", scene.name,
                                 scene.title, scene.figures, scene.paper_says, scene.differs);
  html += fmt::format(
      "<p>Seed {}: the true E is {}, &nu; {:.3f}. {} quadratic tetrahedra. The paper's method found {} and {:.3f} in {} "
      "iterations, {} solves and {:.1f} s; palpate {} ({}) and {:.3f} in {} iterations, {} solves and {:.1f} s.</p>\n",
      first.seed, report::quantity(first.young_modulus_pa, "Pa"), first.poisson_ratio, first.tetrahedra,
      report::quantity(first.paper.young_modulus_pa, "Pa"), first.paper.poisson_ratio, first.paper.iterations, first.paper.solves,
      first.paper.seconds, report::quantity(first.palpate.young_modulus_pa, "Pa"),
      report::interval(first.palpate.lower_95_pa, first.palpate.upper_95_pa, "Pa"), first.palpate.poisson_ratio,
      first.palpate.iterations, first.palpate.solves, first.palpate.seconds);
  if (std::isfinite(first.held_out_palpate_m))
    html += fmt::format("<p>The last push, predicted from the others: its points lie {:.2f} mm (rms) from the surface with the "
                        "paper's E, {:.2f} mm with palpate's; {:.2f} mm if nothing moved.</p>\n",
                        1000 * first.held_out_paper_m, 1000 * first.held_out_palpate_m, 1000 * first.held_out_still_m);
  html += "<table><tr><th>method</th><th>bias of E</th><th>rms of E</th><th>bias of &nu;</th><th>rms of &nu;</th><th>truth in "
          "95 %</th><th>solves</th><th>s</th></tr>\n";
  html += row("the paper's method, linear tetrahedra", score_of(answers.trials, &TrialAnswer::paper_coarse), false);
  html += row("the paper's method on palpate's mesh", score_of(answers.trials, &TrialAnswer::paper), false);
  html += row("palpate", score_of(answers.trials, &TrialAnswer::palpate), true);
  html += fmt::format("</table>\n<p class=\"small\">{} seed{}; errors of E as differences of its logarithm.</p>\n",
                      answers.trials.size(), answers.trials.size() == 1 ? "" : "s");
  if (first.surface.error_m2.size() > 0) {
    html += fmt::format("<p class=\"small\">Grid search: the smallest value of the paper's error function on {} x {} points is {:.4g} "
                        "mm&sup2;; where the paper's method ended it is {:.4g} mm&sup2;, {}.</p>\n",
                        first.surface.error_m2.rows(), first.surface.error_m2.cols(), 1e6 * first.surface.smallest_m2(),
                        1e6 * first.surface.at_found_m2,
                        first.surface.at_found_m2 <= first.surface.smallest_m2() * 1.001
                            ? "no point of the grid is lower: it reached the minimum of its own objective"
                            : "so it did not reach the minimum of its own objective");
    html += figure(surface_figure(first), "The paper's error function over (E, &nu;), dark = small, with the paths of both methods.");
  }
  html += figure(force_figure(first), "Measured force over travel.");
  html += figure(samples_figure(first), "E from every sample alone.");
  return html;
}

}  // namespace

Score score_of(const std::vector<TrialAnswer>& trials, const MethodAnswer TrialAnswer::*method) {
  Score score;
  for (const TrialAnswer& trial : trials) {
    const MethodAnswer& answer = trial.*method;
    const double error = std::log(answer.young_modulus_pa / trial.young_modulus_pa), shift = answer.poisson_ratio - trial.poisson_ratio;
    ++score.trials;
    score.bias_percent += 100 * error;
    score.rms_percent += 1e4 * error * error;
    score.poisson_bias += shift;
    score.poisson_rms += shift * shift;
    score.solves += answer.solves;
    score.seconds += answer.seconds;
    if (!std::isfinite(answer.lower_95_pa)) continue;
    ++score.with_interval;
    score.inside_95 += answer.lower_95_pa <= trial.young_modulus_pa && trial.young_modulus_pa <= answer.upper_95_pa;
  }
  const double count = std::max(1, score.trials);
  score.bias_percent /= count;
  score.rms_percent = std::sqrt(score.rms_percent / count);
  score.poisson_bias /= count;
  score.poisson_rms = std::sqrt(score.poisson_rms / count);
  score.solves /= count;
  score.seconds /= count;
  return score;
}

std::string paper_page(const std::vector<SceneAnswers>& scenes, const std::string& command, int threads) {
  std::string html =
      "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">"
      "<title>The paper's evaluation, remade</title><style>body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem "
      "auto;padding:0 1rem;color:#16202c;background:#fff}table{border-collapse:collapse;display:block;overflow-x:auto}td,th{padding:.25rem "
      ".7rem;border-bottom:1px solid #dfe3e8;text-align:right;white-space:nowrap}td:first-child,th:first-child{text-align:left}"
      "figure{margin:1rem 0}svg{max-width:100%;height:auto}.small,figcaption{color:#55606e;font-size:.9rem}code{font-size:.9rem}</style>"
      "</head><body>\n<h1>The paper's evaluation, remade</h1>\n";
  html += fmt::format(
      "<p>Frank, Schmedding, Stachniss, Teschner and Burgard, <i>Learning the Elasticity Parameters of Deformable Objects with a "
      "Manipulation Robot</i>, IROS 2010. Its experiments, made again by palpate {} on objects of the software lab, whose E is "
      "known. The paper's method is its algorithm 1: iterative closest points, squared distance to the nearest vertex, gradient "
      "descent with numerical derivatives. It gets palpate's mesh, solver, points, start and {} thread{}; a second row gives it linear "
      "tetrahedra, as the paper had. Both see at most 2000 pixels of an image, cut to what lies within 25 mm of the object at rest. All truths are linear elastic with small strains.</p>\n<p><code>{}</code></p>\n",
      version, threads, threads == 1 ? "" : "s", command);
  for (const SceneAnswers& scene : scenes) html += section(scene);
  return html + "</body></html>\n";
}

}  // namespace palpate::cli
