// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "cli/paper_words.hpp"

namespace palpate::cli {
namespace {

std::string score_row(const std::string& method, const Score& score, bool with_intervals) {
  const auto held = [&](int inside) { return with_intervals ? fmt::format("{} of {}", inside, score.asked) : "none"; };
  return fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{} of {}</td><td>{}</td>"
                     "<td>{}</td><td>{}</td></tr>\n",
                     method, number(score.bias_percent, "{:+.1f} %"), number(score.spread_percent, "{:.1f} %"),
                     number(score.rms_percent, "{:.1f} %"), held(score.inside_95), number(score.poisson_bias, "{:+.3f}"),
                     number(score.poisson_rms, "{:.3f}"), held(score.poisson_inside_95), score.without, score.asked,
                     number(score.solves, "{:.0f}"), score.most_load_cases, number(score.seconds, "{:.1f}"));
}

/// E of every sample alone at each site, and how far the sites' means lie apart: what the paper showed of its bear.
std::string spread_by_site(const TrialAnswer& trial) {
  std::vector<std::string> pushes;
  for (const SampleAnswer& sample : trial.samples)
    if (std::find(pushes.begin(), pushes.end(), sample.push) == pushes.end()) pushes.push_back(sample.push);
  if (pushes.size() < 2) return {};
  std::string html = "<table><tr><th>samples alone, at</th><th>samples</th><th>the paper's method: mean &plusmn; standard deviation</th>"
                     "<th>palpate</th></tr>\n";
  std::vector<MethodAnswer> paper_means, palpate_means;
  double paper_within = 0, palpate_within = 0;
  const auto keep = [](std::vector<MethodAnswer>& means, double& within, const Spread& spread) {
    means.push_back(no_answer());
    means.back().young_modulus_pa = spread.mean_pa;
    within += std::isfinite(spread.std_pa) ? spread.std_pa * spread.std_pa : 0;
  };
  for (std::size_t p = 0; p < pushes.size(); ++p) {
    std::vector<const MethodAnswer*> paper, palpate;
    for (const SampleAnswer& sample : trial.samples)
      if (sample.push == pushes[p]) paper.push_back(&sample.paper), palpate.push_back(&sample.palpate);
    const Spread theirs = spread_of(paper), ours = spread_of(palpate);
    keep(paper_means, paper_within, theirs);
    keep(palpate_means, palpate_within, ours);
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                        trial.sites.size() == pushes.size() ? trial.sites[p].site : pushes[p], paper.size(), mean_and_std(theirs),
                        mean_and_std(ours));
  }
  const auto between = [](const std::vector<MethodAnswer>& means) {
    std::vector<const MethodAnswer*> all;
    for (const MethodAnswer& one : means) all.push_back(&one);
    return spread_of(all);
  };
  const auto within = [&](double squares, const Spread& of_means) {
    return number(100 * std::sqrt(squares / static_cast<double>(pushes.size())) / of_means.mean_pa, "{:.1f} %");
  };
  const Spread theirs = between(paper_means), ours = between(palpate_means);
  html += fmt::format("<tr><td>within a site, root mean square</td><td></td><td>{}</td><td>{}</td></tr>\n", within(paper_within, theirs),
                      within(palpate_within, ours));
  html += fmt::format("<tr><td>between the means of the sites</td><td></td><td>{}</td><td>{}</td></tr></table>\n",
                      number(100 * theirs.std_pa / theirs.mean_pa, "{:.1f} %"), number(100 * ours.std_pa / ours.mean_pa, "{:.1f} %"));
  return html;
}

}  // namespace

std::string site_table(const TrialAnswer& trial) {
  if (trial.sites.empty()) return {};
  std::string html = "<table><tr><th>site</th><th>true E</th><th>the paper's method, this push alone</th><th>palpate, all regions at "
                     "once</th><th>95 %</th></tr>\n";
  for (const SiteAnswer& site : trial.sites)
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n", site.site, pascal(site.young_modulus_pa),
                        of_truth(site.paper.young_modulus_pa, site.young_modulus_pa),
                        of_truth(site.palpate.young_modulus_pa, site.young_modulus_pa), interval(site.palpate));
  html += "</table>\n";
  if (!trial.samples.empty())
    html += "<p class=\"small\">Told of no regions, palpate's verdicts are: " + listed(trial.as_one_verdicts) + ".</p>\n";
  return html + spread_by_site(trial);
}

std::string sample_table(const TrialAnswer& trial, bool truth_known) {
  if (trial.samples.empty()) return {};
  std::string html = "<table><tr><th>a sample alone</th><th>samples</th><th>mean E</th><th>standard deviation</th><th>iterations</th>"
                     "<th>simulated</th><th>s</th></tr>\n";
  const auto line = [&](const char* name, const Spread& spread) {
    if (spread.answers == 0) return fmt::format("<tr><td>{}</td><td>0</td></tr>\n", name);
    return fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.1f}</td><td>{:.0f}</td><td>{:.1f}</td></tr>\n", name,
                       spread.answers, truth_known ? of_truth(spread.mean_pa, trial.young_modulus_pa) : pascal(spread.mean_pa),
                       number(100 * spread.std_pa / spread.mean_pa, "{:.1f} %"), spread.iterations, spread.solves, spread.seconds);
  };
  std::vector<const MethodAnswer*> paper, palpate;
  for (const SampleAnswer& sample : trial.samples) paper.push_back(&sample.paper), palpate.push_back(&sample.palpate);
  html += line("the paper's method, this machine", spread_of(paper));
  html += line("palpate, this machine", spread_of(palpate));
  return html + "<tr><td>the paper (2010), its balloon</td><td>7</td><td></td><td></td><td>7</td><td></td><td>192.5</td></tr></table>\n"
                "<p class=\"small\">Means over the samples; the first of a push also solves for the object's answers to loads at that place, which serve the others.</p>\n";
}

std::string unused_table(const lab::PaperScene& scene, const TrialAnswer& trial) {
  if (trial.unused.empty())
    return trial.unused_stop.empty() ? std::string() : "<p>The push that was not to be used did not come about: " + escaped(trial.unused_stop) + "</p>\n";
  std::vector<std::string> names{"the paper's method", "palpate"};
  if (!trial.other_law.empty()) names.push_back("palpate, " + trial.other_law + " law");
  const bool travels = std::any_of(trial.unused.begin(), trial.unused.end(), [](const auto& step) { return std::isfinite(step.travel_m); });
  const bool dents = std::any_of(trial.unused.begin(), trial.unused.end(), [](const auto& step) { return std::isfinite(step.dent_still_m); });
  std::string html = fmt::format("<p>A push that was not used, {}: {}rms distance of what the camera saw to the surface that is expected "
                                 "under the measured force{}.</p>\n<table><tr><th>true force</th>{}",
                                 scene.unused ? "at another place" : "at the same place with other forces",
                                 travels ? "force expected at the measured travel, and " : "",
                                 dents ? "; the dent: rms distance of the true surface, where it moved, to that" : "", travels ? "<th>travel</th>" : "");
  if (travels)
    for (const std::string& name : names) html += "<th>force: " + name + "</th>";
  for (const std::string& name : names) html += "<th>surface: " + name + "</th>";
  html += "<th>surface if nothing moved</th>";
  if (dents) {
    for (const std::string& name : names) html += "<th>dent: " + name + "</th>";
    html += "<th>dent if nothing moved</th>";
  }
  html += "</tr>\n";
  for (const UnusedStep& step : trial.unused) {
    const std::array<const Expectation*, 3> all{&step.paper, &step.palpate, &step.other};
    html += fmt::format("<tr><td>{:.2f} N</td>", step.force_n);
    if (travels) html += "<td>" + number(1000 * step.travel_m, "{:.1f} mm") + "</td>";
    for (std::size_t k = 0; travels && k < names.size(); ++k)
      html += std::isfinite(all[k]->force_n)
                  ? fmt::format("<td>{:.2f} N ({:+.0f} %)</td>", all[k]->force_n, 100 * (all[k]->force_n / step.force_n - 1))
                  : "<td>none</td>";
    for (std::size_t k = 0; k < names.size(); ++k) html += "<td>" + number(1000 * all[k]->surface_m, "{:.2f} mm") + "</td>";
    html += "<td>" + number(1000 * step.surface_still_m, "{:.2f} mm") + "</td>";
    if (dents) {
      for (std::size_t k = 0; k < names.size(); ++k) html += "<td>" + number(1000 * all[k]->dent_m, "{:.2f} mm") + "</td>";
      html += "<td>" + number(1000 * step.dent_still_m, "{:.2f} mm") + "</td>";
    }
    html += "</tr>\n";
  }
  return html + "</table>\n";
}

std::string foresight_table(const SceneAnswers& answers) {
  const SceneForesight all = foresight_of(answers.trials);
  if (all.paper.seeds < 2) return {};
  std::string html = "<table><tr><th>highest force of such a push</th><th>seeds</th><th>force at the measured travel: bias</th><th>rms</th>"
                     "<th>dent, rms</th></tr>\n";
  const auto row = [&](const std::string& name, const Foresight& one) {
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n", name, one.seeds,
                        number(one.force_bias_percent, "{:+.1f} %"), number(one.force_rms_percent, "{:.1f} %"), number(1000 * one.dent_m, "{:.2f} mm"));
  };
  row("the paper's method", all.paper);
  row(answers.scene->other_law.empty() ? "palpate" : fmt::format("palpate, {} law", answers.scene->other_law), all.palpate);
  return html + fmt::format("<tr><td>if nothing moved</td><td>{}</td><td></td><td></td><td>{}</td></tr></table>\n", all.paper.seeds,
                            number(1000 * all.still_m, "{:.2f} mm"));
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

namespace {

/// What is to be known of "simulated", "solved" and seconds.
std::string about_effort() {
  return "Seeds share what was solved for where the object is the same: seconds are of what was left to do, by the clock, whatever else the machine did. Simulated: samples at one (E, "
         "&nu;) that the method asks for, of a seed that it answers, all sites together. Solved: load cases that the finite elements had to be "
         "solved for, at most in a seed. In small strains both methods make every sample up of unit loads solved at a few &nu;, so that the "
         "machine is not what tells them apart (the paper ran a simulation each time); palpate's are with those of its finer mesh and of the "
         "other shapes that it asks about.";
}

/// Of an object that has no E to compare with.
std::string apparent_table(const std::vector<TrialAnswer>& trials) {
  std::string html = "<table><tr><th>method</th><th>E: mean &plusmn; standard deviation over seeds</th><th>mean &nu;</th><th>no answer</th>"
                     "<th>simulated</th><th>solved</th><th>s</th></tr>\n";
  const auto row = [&](const char* name, MethodAnswer TrialAnswer::* method) {
    std::vector<const MethodAnswer*> all;
    for (const TrialAnswer& trial : trials) all.push_back(&(trial.*method));
    const Spread spread = spread_of(all);
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{} of {}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n", name, mean_and_std(spread),
                        number(spread.poisson, "{:.3f}"), spread.without, all.size(), number(spread.solves, "{:.0f}"), spread.most_load_cases,
                        number(spread.seconds, "{:.1f}"));
  };
  row("the paper's method, linear tetrahedra", &TrialAnswer::paper_coarse);
  row("the paper's method on palpate's mesh", &TrialAnswer::paper);
  row("palpate", &TrialAnswer::palpate);
  return html + fmt::format("</table>\n<p class=\"small\">An apparent modulus has no truth: no errors are given, and the claims on top leave "
                            "this scene out. {} seed{}. {}</p>\n",
                            trials.size(), trials.size() == 1 ? "" : "s", about_effort());
}

/// How many samples a seed had, and how deep those went that both methods answer from.
std::string about_samples(const std::vector<TrialAnswer>& trials) {
  std::vector<double> samples, used, deepest_mm;
  for (const TrialAnswer& trial : trials) {
    if (trial.readings.empty()) continue;
    std::set<std::string> pushes;
    for (const ForceReading& reading : trial.readings) pushes.insert(reading.push);
    samples.push_back(static_cast<double>(trial.readings.size()));
    used.push_back(static_cast<double>(trial.readings.size() - static_cast<std::size_t>(trial.left_out)));
    if (trial.left_out > 0 && pushes.size() > 1) continue;  // of which push is not kept
    double deepest = 0;
    for (std::size_t k = 0; k < static_cast<std::size_t>(used.back()); ++k) deepest = std::max(deepest, 1000 * trial.readings[k].travel_m);
    deepest_mm.push_back(deepest);
  }
  if (samples.empty()) return {};
  return fmt::format("A seed has {:.0f} samples (all pushes together), of which {:.0f} are used{} (medians). ", median(samples), median(used),
                     median(deepest_mm) > 0 ? fmt::format(", the deepest at {:.0f} mm", median(deepest_mm)) : "");
}

}  // namespace

std::string score_table(const SceneAnswers& answers) {
  const std::vector<TrialAnswer>& trials = answers.trials;
  const TrialAnswer& shown = answers.shown();
  if (answers.scene->apparent) return apparent_table(trials);
  const bool by_site = !shown.sites.empty();
  std::string html = "<table><tr><th>method</th><th>bias of E</th><th>spread of E</th><th>rms of E</th><th>E in 95 %</th><th>bias of &nu;</th><th>rms of "
                     "&nu;</th><th>&nu; in 95 %</th><th>no answer</th><th>simulated</th><th>solved</th><th>s, median</th></tr>\n";
  const SceneScores scores = scores_of(trials);
  if (!by_site && scores.paper_coarse.answers > 0) html += score_row("the paper's method, linear tetrahedra", scores.paper_coarse, false);
  html += score_row(by_site ? "the paper's method on palpate's mesh, by site" : "the paper's method on palpate's mesh", scores.paper, false);
  html += score_row(shown.other_law.empty() ? "palpate" : "palpate with the " + shown.other_law + " law, which counts", scores.palpate, true);
  if (!shown.other_law.empty()) html += score_row("palpate with the law of the paper's method", scores.palpate_with_the_papers_law, true);
  return html + fmt::format("</table>\n<p class=\"small\">{} seed{}; errors of E as differences of its logarithm, spread: their standard "
                            "deviation. Without an interval nothing is inside. {}{}</p>\n",
                            trials.size(), trials.size() == 1 ? "" : "s", about_samples(trials), about_effort());
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
                        !row.palpate.failed.empty() ? escaped("no answer: " + row.palpate.failed)
                        : std::isfinite(row.palpate.young_modulus_pa) || !row.palpate.verdicts.empty() ? listed(row.palpate.verdicts)
                                                                                                       : "");
  }
  return html + fmt::format("</table>\n<p class=\"small\">Seed {}; true &nu; {:.3f}.</p>\n", answer.seed,
                            answer.rows.empty() ? 0 : answer.rows.front().poisson_ratio);
}

std::string study_score_table(std::span<const StudyAnswer> seeds) {
  if (seeds.size() < 2) return {};
  std::string html = "<table><tr><th>model or fault</th><th>rms of E, the paper's method</th><th>palpate</th><th>bias of E, the paper's method</th>"
                     "<th>palpate</th><th>rms of &nu;, the paper's method</th><th>palpate</th><th>E in palpate's 95 %</th><th>no answer</th>"
                     "<th>palpate's verdicts, seeds with them</th></tr>\n";
  std::string failed;
  for (const StudyScore& row : scores_of(seeds)) {
    std::string said;
    for (const auto& [code, count] : row.verdicts) said += fmt::format("{}{} ({})", said.empty() ? "" : ", ", code, count);
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{} / {}</td><td>{}</td></tr>\n",
                        row.what, number(row.paper.rms_percent, "{:.1f} %"), number(row.palpate.rms_percent, "{:.1f} %"),
                        number(row.paper.bias_percent, "{:+.1f} %"), number(row.palpate.bias_percent, "{:+.1f} %"),
                        number(row.paper.poisson_rms, "{:.3f}"), number(row.palpate.poisson_rms, "{:.3f}"),
                        row.palpate.asked > 0 ? fmt::format("{} of {}", row.palpate.inside_95, row.palpate.asked) : "", row.paper.without,
                        row.palpate.without, row.palpate.asked == 0 ? "" : said.empty() ? "none" : said);
  }
  for (const StudyAnswer& seed : seeds)
    if (!seed.failed.empty()) failed += fmt::format(" Seed {} ended with an error: {}.", seed.seed, escaped(seed.failed));
  return html + fmt::format("</table>\n<p class=\"small\">{} seeds; errors of E as differences of its logarithm. No answer: the paper's method / palpate. "
                            "Without an interval nothing is inside.{}</p>\n",
                            seeds.size(), failed);
}

}  // namespace palpate::cli
