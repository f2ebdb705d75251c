// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "cli/paper_figures.hpp"
#include "palpate/core/version.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

std::string site_table(const TrialAnswer& trial) {
  if (trial.sites.empty()) return {};
  std::string html = "<table><tr><th>site</th><th>true E</th><th>the paper's method, this push alone</th><th>palpate, all regions at "
                     "once</th><th>95 %</th></tr>\n";
  for (const SiteAnswer& site : trial.sites)
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{} ({:+.0f} %)</td><td>{} ({:+.0f} %)</td><td>{}</td></tr>\n", site.site,
                        report::quantity(site.young_modulus_pa, "Pa"), report::quantity(site.paper.young_modulus_pa, "Pa"),
                        100 * (site.paper.young_modulus_pa / site.young_modulus_pa - 1),
                        report::quantity(site.palpate.young_modulus_pa, "Pa"),
                        100 * (site.palpate.young_modulus_pa / site.young_modulus_pa - 1),
                        report::interval(site.palpate.lower_95_pa, site.palpate.upper_95_pa, "Pa"));
  html += "</table>\n";
  if (!trial.as_one_verdicts.empty()) {
    std::string codes;
    for (const std::string& code : trial.as_one_verdicts) codes += (codes.empty() ? "" : ", ") + code;
    html += "<p class=\"small\">Told of no regions, palpate's verdicts are: " + codes + ".</p>\n";
  } else {
    html += "<p class=\"small\">Told of no regions, palpate had no verdict.</p>\n";
  }
  return html;
}

std::string unused_table(const TrialAnswer& trial) {
  if (trial.unused.empty()) return {};
  std::string html = "<p>A push at a place that was not used: force expected at the measured travel, and rms distance of what the camera "
                     "saw to the expected surface.</p>\n<table><tr><th>true force</th><th>travel</th><th>force: the paper's "
                     "method</th><th>palpate</th><th>surface: the paper's method</th><th>palpate</th><th>if nothing moved</th></tr>\n";
  for (const UnusedStep& step : trial.unused)
    html += fmt::format("<tr><td>{:.2f} N</td><td>{:.1f} mm</td><td>{:.2f} N ({:+.0f} %)</td><td>{:.2f} N ({:+.0f} %)</td><td>{:.2f} mm</td>"
                        "<td>{:.2f} mm</td><td>{:.2f} mm</td></tr>\n",
                        step.force_n, 1000 * step.travel_m, step.force_paper_n, 100 * (step.force_paper_n / step.force_n - 1),
                        step.force_palpate_n, 100 * (step.force_palpate_n / step.force_n - 1), 1000 * step.surface_paper_m,
                        1000 * step.surface_palpate_m, 1000 * step.surface_still_m);
  return html + "</table>\n";
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
  html += fmt::format("<p>Seed {}: the true E is {}{}, &nu; {:.3f}. {} quadratic tetrahedra. The paper's method found {} and {:.3f} in {} "
                      "iterations, {} solves and {:.1f} s",
                      first.seed, report::quantity(first.young_modulus_pa, "Pa"),
                      first.sites.empty() ? "" : " at " + first.sites.front().site, first.poisson_ratio, first.tetrahedra,
                      report::quantity(first.paper.young_modulus_pa, "Pa"), first.paper.poisson_ratio, first.paper.iterations,
                      first.paper.solves, first.paper.seconds);
  html += fmt::format("; palpate {} ({}) and {:.3f} in {} iterations, {} solves and {:.1f} s.</p>\n",
                      report::quantity(first.palpate.young_modulus_pa, "Pa"),
                      report::interval(first.palpate.lower_95_pa, first.palpate.upper_95_pa, "Pa"), first.palpate.poisson_ratio,
                      first.palpate.iterations, first.palpate.solves, first.palpate.seconds);
  html += site_table(first) + unused_table(first);
  html += "<table><tr><th>method</th><th>bias of E</th><th>rms of E</th><th>bias of &nu;</th><th>rms of &nu;</th><th>truth in "
          "95 %</th><th>solves</th><th>s</th></tr>\n";
  const SceneScores scores = scores_of(answers.trials);
  if (first.sites.empty()) html += row("the paper's method, linear tetrahedra", scores.paper_coarse, false);
  html += row(first.sites.empty() ? "the paper's method on palpate's mesh" : "the paper's method on palpate's mesh, by site", scores.paper, false);
  html += row("palpate", scores.palpate, true);
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
  html += figure(registration_figure(first),
                 "What the camera saw of the hardest push, registered with the surface that each E gives; the last is the true one.");
  html += figure(force_figure(first), "Measured force over travel.");
  html += figure(samples_figure(first), "E from every sample alone.");
  return html;
}

}  // namespace

namespace {

/// One E with its truth: of the whole object, or of a site of one with regions.
struct Compared {
  double young_modulus_pa = 0, poisson_ratio = 0;
  const MethodAnswer* answer = nullptr;
};

Score score_of(const std::vector<Compared>& all) {
  Score score;
  for (const Compared& one : all) {
    const MethodAnswer& answer = *one.answer;
    const double error = std::log(answer.young_modulus_pa / one.young_modulus_pa), shift = answer.poisson_ratio - one.poisson_ratio;
    ++score.answers;
    score.bias_percent += 100 * error;
    score.rms_percent += 1e4 * error * error;
    score.poisson_bias += shift;
    score.poisson_rms += shift * shift;
    score.solves += answer.solves;
    score.seconds += answer.seconds;
    if (!std::isfinite(answer.lower_95_pa)) continue;
    ++score.with_interval;
    score.inside_95 += answer.lower_95_pa <= one.young_modulus_pa && one.young_modulus_pa <= answer.upper_95_pa;
  }
  const double count = std::max(1, score.answers);
  score.bias_percent /= count;
  score.rms_percent = std::sqrt(score.rms_percent / count);
  score.poisson_bias /= count;
  score.poisson_rms = std::sqrt(score.poisson_rms / count);
  score.solves /= count;
  score.seconds /= count;
  return score;
}

/// What the evaluation has to show, over all scenes, and whether it does.
std::string claims(const std::vector<SceneAnswers>& scenes) {
  std::vector<double> shares;
  std::string worse, dear;
  int inside = 0, intervals = 0;
  std::size_t least = 1000000;
  for (const SceneAnswers& scene : scenes) {
    const SceneScores scores = scores_of(scene.trials);
    shares.push_back(scores.palpate.rms_percent / scores.paper.rms_percent);
    const std::string name(scene.scene->name);
    if (!(shares.back() < 1)) worse += (worse.empty() ? "" : ", ") + name;
    if (!(scores.palpate.solves <= 0.2 * scores.paper.solves)) dear += (dear.empty() ? "" : ", ") + name;
    inside += scores.palpate.inside_95;
    intervals += scores.palpate.with_interval;
    least = std::min(least, scene.trials.size());
  }
  if (shares.empty()) return {};
  std::sort(shares.begin(), shares.end());
  const double median = 0.5 * (shares[shares.size() / 2] + shares[(shares.size() - 1) / 2]);
  const double in = intervals > 0 ? 100.0 * inside / intervals : 0;
  const auto line = [](const std::string& what, bool holds, const std::string& found) {
    return fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n", what, holds ? "yes" : "<b>no</b>", found);
  };
  std::string html = "<h2>What it should show, and whether it does</h2>\n<table><tr><th>claim</th><th>holds</th><th>found</th></tr>\n";
  html += line("palpate's rms error of E is smaller in every scene", worse.empty(), worse.empty() ? "in all" : "not in: " + worse);
  html += line("in the median scene it is at most half", median <= 0.5, fmt::format("{:.2f} of the paper's method's", median));
  html += line("at least 88 % of the truths lie in palpate's 95 % intervals", in >= 88, fmt::format("{:.0f} % of {}", in, intervals));
  html += line("palpate needs at most a fifth of the solves", dear.empty(), dear.empty() ? "in all" : "not in: " + dear);
  return html + fmt::format("</table>\n<p class=\"small\">{} seed{} a scene at least{}.</p>\n", least, least == 1 ? "" : "s",
                            least < 100 ? ": too few to say so; a full run has 100" : "");
}

}  // namespace

SceneScores scores_of(const std::vector<TrialAnswer>& trials) {
  std::vector<Compared> paper, coarse, palpate;
  for (const TrialAnswer& trial : trials) {
    coarse.push_back({trial.young_modulus_pa, trial.poisson_ratio, &trial.paper_coarse});
    if (trial.sites.empty()) {
      paper.push_back({trial.young_modulus_pa, trial.poisson_ratio, &trial.paper});
      palpate.push_back({trial.young_modulus_pa, trial.poisson_ratio, &trial.palpate});
    }
    for (const SiteAnswer& site : trial.sites) {
      paper.push_back({site.young_modulus_pa, trial.poisson_ratio, &site.paper});
      palpate.push_back({site.young_modulus_pa, trial.poisson_ratio, &site.palpate});
    }
  }
  return {score_of(paper), score_of(coarse), score_of(palpate)};
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
  html += claims(scenes);
  for (const SceneAnswers& scene : scenes) html += section(scene);
  return html + "</body></html>\n";
}

}  // namespace palpate::cli
