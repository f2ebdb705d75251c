// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_page.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <string_view>

#include "cli/paper_figures.hpp"
#include "cli/paper_overview.hpp"
#include "cli/paper_tables.hpp"
#include "cli/paper_words.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

/// Every pixel of the camera as a square of the same size in all of them.
std::string view_figures(const std::vector<PaperView>& views) {
  std::string html;
  for (const PaperView& view : views) {
    const double scale = std::max(1.0, std::round(320.0 / std::max(view.width, 1)));
    html += fmt::format("<figure class=\"view\"><img alt=\"\" width=\"{:.0f}\" height=\"{:.0f}\" src=\"data:image/png;base64,{}\"><figcaption>{}.</figcaption></figure>\n",
                        scale * view.width, scale * view.height, view.png, view.what);
  }
  return html.empty() ? html : "<div class=\"views\">" + html + "</div>\n";
}

/// Which of the paper's figures shows the same of this scene. @param candidates  "4" or "5 (a)"
std::string as_in_the_paper(std::string_view of_scene, std::initializer_list<std::string_view> candidates) {
  for (const std::string_view candidate : candidates)
    for (std::size_t from = 0, to = 0; from < of_scene.size(); from = to + 2) {
      to = std::min(of_scene.find(", ", from), of_scene.size());
      if (of_scene.substr(from, to - from) == candidate.substr(0, candidate.find(' '))) return fmt::format("As fig. {} of the paper. ", candidate);
    }
  return {};
}

std::string figure(const std::string& svg, const std::string& caption) {
  return svg.empty() ? std::string() : "<figure>" + svg + "<figcaption>" + caption + "</figcaption></figure>\n";
}

std::string found(const MethodAnswer& answer) {
  const std::string took =
      fmt::format(" in {} iterations, {} simulated samples and {:.1f} s", answer.iterations, answer.solves, answer.seconds);
  if (!std::isfinite(answer.young_modulus_pa)) return "found no answer" + took;
  const std::string interval =
      std::isfinite(answer.lower_95_pa) ? " (" + report::interval(answer.lower_95_pa, answer.upper_95_pa, "Pa") + ")" : "";
  return fmt::format("found {}{} and &nu; {:.3f}", pascal(answer.young_modulus_pa), interval, answer.poisson_ratio) + took +
         (answer.converged ? "" : ", without converging");
}

/// Share of the grid's inner points at which the error, over log E and nu, bends upwards whichever way one goes.
std::string convexity(const ErrorSurface& surface) {
  const MatrixX& e = surface.error_m2;
  if (e.rows() < 3 || e.cols() < 3 || !e.allFinite()) return {};
  Eigen::Index row = 0, column = 0;
  e.minCoeff(&row, &column);
  int inner = 0, convex = 0;
  bool at_lowest = false;
  for (Eigen::Index i = 1; i + 1 < e.rows(); ++i)
    for (Eigen::Index k = 1; k + 1 < e.cols(); ++k) {
      const double along_e = e(i + 1, k) - 2 * e(i, k) + e(i - 1, k), along_nu = e(i, k + 1) - 2 * e(i, k) + e(i, k - 1),
                   mixed = 0.25 * (e(i + 1, k + 1) - e(i + 1, k - 1) - e(i - 1, k + 1) + e(i - 1, k - 1));
      const bool bends = along_e > 0 && along_e * along_nu > mixed * mixed;
      ++inner;
      convex += bends;
      at_lowest = at_lowest || (bends && i == row && k == column);
    }
  return fmt::format(" It is convex in (log E, &nu;) at {} of the {} inner points of the grid{}.", convex, inner,
                     at_lowest ? ", the lowest among them" : row == 0 || row + 1 == e.rows() || column == 0 || column + 1 == e.cols()
                                                                 ? "; the lowest is at its rim"
                                                                 : ", not at the lowest");
}

/// Where both methods come to from elsewhere.
std::string starts_table(const TrialAnswer& trial) {
  if (trial.starts.empty()) return {};
  std::string html = "<table><tr><th>start</th><th>the paper's method comes to</th><th>palpate comes to</th></tr>\n";
  const auto place = [](double young_pa, double nu) { return std::isfinite(young_pa) ? pascal(young_pa) + fmt::format(", &nu; {:.3f}", nu) : "none"; };
  const auto row = [&](const std::string& start, const MethodAnswer& paper, const MethodAnswer& palpate) {
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n", start, place(paper.young_modulus_pa, paper.poisson_ratio),
                        place(palpate.young_modulus_pa, palpate.poisson_ratio));
  };
  row("its own (as above)", trial.paper, trial.palpate);
  for (const StartAnswer& from : trial.starts)
    row(place(from.young_modulus_pa, from.poisson_ratio) + (&from == &trial.starts.back() ? ", the grid's lowest" : ""), from.paper, from.palpate);
  return html + "</table>\n";
}

std::string grid_search(const TrialAnswer& trial) {
  const ErrorSurface& surface = trial.surface;
  if (surface.error_m2.size() == 0) return {};
  const std::string points = surface.error_m2.cols() > 1
                                 ? fmt::format("{} x {} points", surface.error_m2.rows(), surface.error_m2.cols())
                                 : fmt::format("{} values of E at its &nu;", surface.error_m2.rows());
  Eigen::Index row = 0, column = 0;
  surface.error_m2.minCoeff(&row, &column);
  const Eigen::Index flat = (surface.error_m2.array() <= 1.01 * surface.smallest_m2()).count();
  return fmt::format("<p class=\"small\">Grid search: the smallest value of the paper's error function on {} is {:.4g} mm&sup2;, at E = {} and "
                     "&nu; = {:.3f}; where the paper's method ended it is {:.4g} mm&sup2;, {}. {} of the {} points are within a hundredth of "
                     "the smallest{}.{}</p>\n",
                     points, 1e6 * surface.smallest_m2(), pascal(surface.young_modulus_pa(row)), surface.poisson_ratio(column),
                     1e6 * surface.at_found_m2,
                     surface.at_found_m2 <= surface.smallest_m2() * 1.001
                         ? "and no point of the grid is lower by a thousandth: it is as low as its own objective gets"
                         : "so it did not reach the minimum of its own objective",
                     flat, surface.error_m2.size(), flat > 5 ? ": it says little of where the minimum is" : "",
                     convexity(surface)) +
         starts_table(trial);
}

std::string section(const SceneAnswers& answers) {
  const lab::PaperScene& scene = *answers.scene;
  const TrialAnswer& first = answers.shown();
  std::string html = fmt::format("<h2 id=\"{}\">{}</h2>\n<p><b>The paper</b>{}: {}<br><b>Here</b>: {}</p>\n", scene.name, scene.title,
                                 scene.figures.empty() ? "" : fmt::format(" (fig. {})", scene.figures), scene.paper_says, scene.differs);
  if (!first.failed.empty() && first.tetrahedra == 0) return html + failed_table(answers.trials);  // no seed came as far as a model
  html += scene.apparent ? fmt::format("<p>Seed {}: ", first.seed)
                         : fmt::format("<p>Seed {}: the true E is {}{}, &nu; {:.3f}. ", first.seed, pascal(first.young_modulus_pa),
                                       first.sites.empty() ? "" : " at " + first.sites.front().site, first.poisson_ratio);
  html += fmt::format("{} quadratic tetrahedra. The paper's method {}; palpate {}.", first.tetrahedra, found(first.paper), found(first.palpate));
  if (!first.other_law.empty()) html += fmt::format(" With the {} law palpate {}.", first.other_law, found(first.other));
  if (first.left_out > 0)
    html += fmt::format(" Both answer from the lower {} of {} samples: under the others the pad presses with more than {:.1f} E, where the simulated "
                        "patch caves in.",
                        first.readings.size() - static_cast<std::size_t>(first.left_out), first.readings.size(), estimation::largest_pressure);
  html += "</p>\n<p>Palpate's verdicts: " + listed(first.palpate.verdicts) +
          (first.other_law.empty() ? "" : "; with the " + first.other_law + " law: " + listed(first.other.verdicts)) + ".</p>\n";
  html += site_table(first) + unused_table(scene, first) + foresight_table(answers) + sample_table(first, !scene.apparent && first.sites.empty());
  html += score_table(answers) + failed_table(answers.trials) + seed_table(answers);
  html += grid_search(first);
  const auto as = [&](auto... candidates) { return as_in_the_paper(scene.figures, {candidates...}); };
  html += figure(surface_figure(first), as("4") + "The paper's error function over (E, &nu;), dark = small, with the paths of both methods; the large dot is the lowest point of the grid, the smallest ones are where they began.");
  html += figure(error_figure(first), as("5 (b)") + "The paper's error function over E alone, at the &nu; where its method ended.");
  html += figure(registration_figure(first),
                 as("3", "6", "7", "10") + "What the camera saw of the hardest push that is used, registered with the surface that each E gives, where these differ most (grey: the surface); the last is " +
                     (scene.apparent ? "the one that palpate found." : "the true one."));
  if (!first.views.empty()) html += "<p class=\"small\">" + as("1", "10") + "What the camera saw, and what was made of it.</p>\n";
  html += view_figures(first.views);
  html += figure(force_figure(first), as("5 (a)") + "Measured force over travel.");
  html += figure(samples_figure(first),
                 as("5 (c)", "8", "9") + "E from samples alone" + (first.other_law.empty() ? "" : ", by palpate with the law of the paper's method") +
                     (first.sites.empty() ? "; the lines are E from all samples jointly." : ", of the object as one stuff; the lines are of all samples, palpate's of all regions at once, dashed: the truth."));
  return html;
}

/// What the evaluation has to show, over all scenes, and whether it does.
std::string claims(const std::vector<SceneAnswers>& scenes) {
  const std::vector<Claim> all = claims_of(scenes);
  if (all.empty()) return {};
  std::string html = "<h2>What it should show, and whether it does</h2>\n<table><tr><th>claim</th><th>holds</th><th>found</th></tr>\n";
  for (const Claim& claim : all)
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n", claim.what, claim.holds ? "yes" : "<b>no</b>", claim.found);
  std::size_t least = scenes.front().trials.size();
  for (const SceneAnswers& scene : scenes) least = std::min(least, scene.trials.size());
  return html + fmt::format("</table>\n<p class=\"small\">{} seed{} a scene at least{}.</p>\n", least, least == 1 ? "" : "s",
                            least < 100 ? ": too few to say so; a full run has 100" : "");
}

/// @param seeds  of one study; that of the details is shown, or else the first
std::string study_section(std::span<const StudyAnswer> seeds, std::uint64_t details_of) {
  const auto detailed = std::find_if(seeds.begin(), seeds.end(), [&](const StudyAnswer& one) { return one.seed == details_of; });
  const StudyAnswer& shown = detailed != seeds.end() ? *detailed : seeds.front();
  std::string pictures;
  for (const StudyRow& row : shown.rows)
    if (!row.views.empty()) pictures += fmt::format("<p>{}:</p>\n", row.what) + view_figures(row.views);
  return fmt::format("<h2 id=\"{}\">{}</h2>\n<p>{}</p>\n", shown.study->name, shown.study->title, shown.study->about) + study_score_table(seeds) +
         study_table(shown) + pictures + (shown.failed.empty() ? "" : "<p>It ended with an error: " + escaped(shown.failed) + "</p>\n");
}

}  // namespace

std::string paper_page(const std::vector<SceneAnswers>& scenes, const std::vector<StudyAnswer>& studies, const std::string& version,
                       const std::string& command, const std::set<int>& threads, std::uint64_t details_of, bool coarse) {
  std::string html =
      "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">"
      "<title>The paper's evaluation, remade</title><style>body{font:16px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem "
      "auto;padding:0 1rem;color:#16202c;background:#fff}table{border-collapse:collapse;display:block;overflow-x:auto;margin:1rem 0}td,th{padding:.25rem "
      ".7rem;border-bottom:1px solid #dfe3e8;text-align:right;white-space:nowrap}th{white-space:normal;vertical-align:bottom}"
      "td:first-child,th:first-child{text-align:left}td:last-child,td:first-child{white-space:normal;min-width:5rem}figure{margin:1rem 0}.views{display:flex;flex-wrap:wrap;gap:1rem}.view{margin:0;max-width:min(100%,40rem)}.view img{max-width:100%;height:auto;image-rendering:pixelated;border:1px solid #dfe3e8}svg{max-width:100%;height:auto}"
      ".words{min-width:16rem;max-width:24rem;text-align:left;white-space:normal}.small,figcaption{color:#55606e;font-size:.9rem}code{font-size:.9rem}</style>"
      "</head><body>\n<h1>The paper's evaluation, remade</h1>\n";
  html += fmt::format(
      "<p>Frank, Schmedding, Stachniss, Teschner and Burgard, <i>Learning the Elasticity Parameters of Deformable Objects with a "
      "Manipulation Robot</i>, IROS 2010. Its experiments, made again by palpate {} on objects of the software lab, whose E is "
      "known (but for the balloon's). The paper's method is its algorithm 1: iterative closest points, squared distance to the nearest "
      "vertex, gradient descent with numerical derivatives. It gets palpate's mesh, solver, points, starts (where the first has no equilibrium: a "
      "quarter and four times of its E) and threads ({}); of the seed with pictures a second row gives it linear tetrahedra, as the paper had (where strains are small and the object has one E). "
      "Both are fitted to all samples jointly, where the paper averaged fits of one sample each (tables of samples alone do that); the bear by its method site by site, as there. Palpate also gets what the "
      "paper's method has no use for: the tool's travel, the unloaded frame, and what is known of the sensors' noise (of depths, forces, "
      "encoders and the camera's pose). Both see at most {} pixels of an image, cut to what lies within 25 mm of the "
      "object at rest (where a push goes deeper: its depth). Where a scene does not say otherwise, the truth is linear elastic with small strains.</p>\n<p><code>{}</code></p>\n",
      version, fmt::join(threads, ", "), coarse ? coarse_points : usual_points, command);
  if (coarse)
    html += fmt::format("<p><b>A quick look</b> (<code>--quick</code>): about {} tetrahedra and four samples a push (where the others say seven; a push that slips has all), a third of the points, "
                        "the truth on a quarter of its mesh; and nobody asks what meshes and unseen sides do to E: no interval holds that. It shows that "
                        "every experiment runs and what it looks like. Numbers that count are those without it.</p>\n",
                        coarse_tetrahedra);
  html += claims(scenes);
  if (!scenes.empty()) html += overview_table(scenes);
  for (const SceneAnswers& scene : scenes) html += section(scene);
  for (std::size_t from = 0, to = 0; from < studies.size(); from = to) {
    for (to = from; to < studies.size() && studies[to].study == studies[from].study;) ++to;
    html += study_section(std::span(studies).subspan(from, to - from), details_of);
  }
  return html + "</body></html>\n";
}

}  // namespace palpate::cli
