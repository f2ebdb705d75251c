// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

std::string of_truth(double found, double truth) {
  return std::isfinite(found) ? fmt::format("{} ({:+.0f} %)", pascal(found), 100 * (found / truth - 1)) : "none";
}

std::string interval(const MethodAnswer& answer) {
  return std::isfinite(answer.lower_95_pa) ? report::interval(answer.lower_95_pa, answer.upper_95_pa, "Pa") : "none";
}

std::string number(double value, const char* format) { return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : "none"; }

std::string score_row(const std::string& method, const Score& score, bool with_intervals) {
  const auto held = [&](int inside) { return with_intervals ? fmt::format("{} of {}", inside, score.asked) : "none"; };
  return fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{} of {}</td><td>{}</td>"
                     "<td>{}</td><td>{}</td></tr>\n",
                     method, number(score.bias_percent, "{:+.1f} %"), number(score.spread_percent, "{:.1f} %"),
                     number(score.rms_percent, "{:.1f} %"), held(score.inside_95), number(score.poisson_bias, "{:+.3f}"),
                     number(score.poisson_rms, "{:.3f}"), held(score.poisson_inside_95), score.without, score.asked,
                     number(score.solves, "{:.0f}"), score.most_load_cases, number(score.seconds, "{:.1f}"));
}

/// Of one method over the samples alone.
struct Spread {
  int answers = 0;
  double mean_pa = 0, std_pa = 0, iterations = 0, solves = 0, seconds = 0;
};
Spread spread_of(const TrialAnswer& trial, MethodAnswer SampleAnswer::* method) {
  Spread spread;
  double square = 0;
  for (const SampleAnswer& sample : trial.samples) {
    const MethodAnswer& answer = sample.*method;
    if (!std::isfinite(answer.young_modulus_pa)) continue;
    ++spread.answers;
    spread.mean_pa += answer.young_modulus_pa;
    square += answer.young_modulus_pa * answer.young_modulus_pa;
    spread.iterations += answer.iterations;
    spread.solves += answer.solves;
    spread.seconds += answer.seconds;
  }
  const double count = spread.answers;
  spread.mean_pa /= count;
  spread.std_pa = std::sqrt(std::max(0.0, square / count - spread.mean_pa * spread.mean_pa));
  spread.iterations /= count;
  spread.solves /= count;
  spread.seconds /= count;
  return spread;
}

}  // namespace

std::string pascal(double young_modulus_pa) {
  return std::isfinite(young_modulus_pa) ? report::quantity(young_modulus_pa, "Pa") : "none";
}

std::string escaped(const std::string& words) {
  std::string out;
  for (const char letter : words) out += letter == '<' ? "&lt;" : letter == '>' ? "&gt;" : letter == '&' ? "&amp;" : std::string(1, letter);
  return out;
}

std::string listed(const std::vector<std::string>& codes) {
  std::vector<std::pair<std::string, int>> counted;
  for (const std::string& code : codes) {
    const auto known = std::find_if(counted.begin(), counted.end(), [&](const auto& one) { return one.first == code; });
    if (known == counted.end()) {
      counted.emplace_back(code, 1);
    } else {
      ++known->second;
    }
  }
  std::string all;
  for (const auto& [code, count] : counted)
    all += (all.empty() ? "" : ", ") + code + (count > 1 ? fmt::format(" ({} times)", count) : "");
  return all.empty() ? "none" : all;
}

std::string site_table(const TrialAnswer& trial) {
  if (trial.sites.empty()) return {};
  std::string html = "<table><tr><th>site</th><th>true E</th><th>the paper's method, this push alone</th><th>palpate, all regions at "
                     "once</th><th>95 %</th></tr>\n";
  for (const SiteAnswer& site : trial.sites)
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n", site.site, pascal(site.young_modulus_pa),
                        of_truth(site.paper.young_modulus_pa, site.young_modulus_pa),
                        of_truth(site.palpate.young_modulus_pa, site.young_modulus_pa), interval(site.palpate));
  return html + "</table>\n<p class=\"small\">Told of no regions, palpate's verdicts are: " + listed(trial.as_one_verdicts) + ".</p>\n";
}

std::string sample_table(const TrialAnswer& trial, bool truth_known) {
  if (trial.samples.empty()) return {};
  std::string html = "<table><tr><th>a sample alone</th><th>samples</th><th>mean E</th><th>standard deviation</th><th>iterations</th>"
                     "<th>simulated</th><th>s</th></tr>\n";
  const auto line = [&](const char* name, const Spread& spread) {
    if (spread.answers == 0) return fmt::format("<tr><td>{}</td><td>0</td></tr>\n", name);
    return fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.1f} %</td><td>{:.1f}</td><td>{:.0f}</td><td>{:.1f}</td></tr>\n", name,
                       spread.answers, truth_known ? of_truth(spread.mean_pa, trial.young_modulus_pa) : pascal(spread.mean_pa),
                       100 * spread.std_pa / spread.mean_pa, spread.iterations, spread.solves, spread.seconds);
  };
  html += line("the paper's method, this machine", spread_of(trial, &SampleAnswer::paper));
  html += line("palpate, this machine", spread_of(trial, &SampleAnswer::palpate));
  return html + "<tr><td>the paper (2010), its balloon</td><td>7</td><td></td><td></td><td>7</td><td></td><td>192.5</td></tr></table>\n";
}

std::string unused_table(const lab::PaperScene& scene, const TrialAnswer& trial) {
  if (trial.unused.empty()) return {};
  std::vector<std::string> names{"the paper's method", "palpate"};
  if (!trial.other_law.empty()) names.push_back("palpate, " + trial.other_law + " law");
  const bool travels = std::any_of(trial.unused.begin(), trial.unused.end(), [](const auto& step) { return std::isfinite(step.travel_m); });
  std::string html = fmt::format("<p>A push that was not used, {}: {}rms distance of what the camera saw to the surface that is expected "
                                 "under the measured force.</p>\n<table><tr><th>true force</th>{}",
                                 scene.unused ? "at another place" : "at the same place with other forces",
                                 travels ? "force expected at the measured travel, and " : "", travels ? "<th>travel</th>" : "");
  if (travels)
    for (const std::string& name : names) html += "<th>force: " + name + "</th>";
  for (const std::string& name : names) html += "<th>surface: " + name + "</th>";
  html += "<th>surface if nothing moved</th></tr>\n";
  for (const UnusedStep& step : trial.unused) {
    const std::array<const Expectation*, 3> all{&step.paper, &step.palpate, &step.other};
    html += fmt::format("<tr><td>{:.2f} N</td>", step.force_n);
    if (travels) html += "<td>" + number(1000 * step.travel_m, "{:.1f} mm") + "</td>";
    for (std::size_t k = 0; travels && k < names.size(); ++k)
      html += std::isfinite(all[k]->force_n)
                  ? fmt::format("<td>{:.2f} N ({:+.0f} %)</td>", all[k]->force_n, 100 * (all[k]->force_n / step.force_n - 1))
                  : "<td>none</td>";
    for (std::size_t k = 0; k < names.size(); ++k) html += "<td>" + number(1000 * all[k]->surface_m, "{:.2f} mm") + "</td>";
    html += "<td>" + number(1000 * step.surface_still_m, "{:.2f} mm") + "</td></tr>\n";
  }
  return html + "</table>\n";
}

std::string failed_table(const std::vector<TrialAnswer>& trials) {
  std::string rows;
  const auto row = [&](std::uint64_t seed, const char* what, const std::string& why) {
    if (!why.empty()) rows += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n", seed, what, escaped(why));
  };
  for (const TrialAnswer& trial : trials) {
    row(trial.seed, "the seed", trial.failed);
    row(trial.seed, "the paper's method", trial.paper.failed);
    row(trial.seed, "palpate", trial.palpate.failed);
  }
  if (rows.empty()) return {};
  return "<table><tr><th>seed that failed</th><th>what ended</th><th>why</th></tr>\n" + rows + "</table>\n";
}

std::string score_table(const SceneAnswers& answers) {
  const lab::PaperScene& scene = *answers.scene;
  const std::vector<TrialAnswer>& trials = answers.trials;
  const TrialAnswer& shown = answers.shown();
  if (scene.apparent)
    return "<p class=\"small\">An apparent modulus has no truth: no errors are given, and the claims on top leave this scene out.</p>\n";
  const bool by_site = !shown.sites.empty();
  std::string html = "<table><tr><th>method</th><th>bias of E</th><th>spread of E</th><th>rms of E</th><th>E in 95 %</th><th>bias of &nu;</th><th>rms of "
                     "&nu;</th><th>&nu; in 95 %</th><th>no answer</th><th>simulated</th><th>solved</th><th>s</th></tr>\n";
  const SceneScores scores = scores_of(trials);
  if (!by_site && scores.paper_coarse.answers > 0) html += score_row("the paper's method, linear tetrahedra", scores.paper_coarse, false);
  html += score_row(by_site ? "the paper's method on palpate's mesh, by site" : "the paper's method on palpate's mesh", scores.paper, false);
  html += score_row("palpate", scores.palpate, true);
  if (!shown.other_law.empty()) html += score_row("palpate with the " + shown.other_law + " law", scores.other, true);
  return html + fmt::format("</table>\n<p class=\"small\">{} seed{}; errors of E as differences of its logarithm, spread: their standard deviation. "
                            "Without an interval nothing is inside. Seeds share what was solved for where the object is the same: seconds are "
                            "of what was left to do. Simulated: samples at one (E, &nu;) that the method asks for, of a seed that it answers, "
                            "all sites together. Solved: load cases that the finite elements had to be solved for, at most in a seed. In small "
                            "strains both methods make every sample up of unit loads solved at a few &nu;, so that the machine is not what tells "
                            "them apart (the paper ran a simulation each time); palpate's are with those of its finer mesh and of the other "
                            "shapes that it asks about.</p>\n",
                            trials.size(), trials.size() == 1 ? "" : "s");
}

std::string study_table(const StudyAnswer& answer) {
  std::string html = "<table><tr><th>model or fault</th><th>true E</th><th>the paper's method</th><th>its &nu;</th><th>palpate</th><th>95 "
                     "%</th><th>its &nu;</th><th>truth inside</th><th>palpate's verdicts</th></tr>\n";
  for (const StudyRow& row : answer.rows) {
    const bool interval_there = std::isfinite(row.palpate.lower_95_pa);
    const bool inside = row.palpate.lower_95_pa <= row.young_modulus_pa && row.young_modulus_pa <= row.palpate.upper_95_pa;
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                        row.what, pascal(row.young_modulus_pa), of_truth(row.paper.young_modulus_pa, row.young_modulus_pa),
                        number(row.paper.poisson_ratio, "{:.3f}"), of_truth(row.palpate.young_modulus_pa, row.young_modulus_pa),
                        interval(row.palpate), number(row.palpate.poisson_ratio, "{:.3f}"),
                        !interval_there ? "" : inside ? "yes" : "<b>no</b>",
                        std::isfinite(row.palpate.young_modulus_pa) || !row.palpate.verdicts.empty() ? listed(row.palpate.verdicts) : "");
  }
  return html + fmt::format("</table>\n<p class=\"small\">Seed {}; true &nu; {:.3f}.</p>\n", answer.seed,
                            answer.rows.empty() ? 0 : answer.rows.front().poisson_ratio);
}

}  // namespace palpate::cli
