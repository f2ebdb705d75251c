// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_overview.hpp"

#include <fmt/format.h>

#include <cmath>

#include "cli/paper_words.hpp"

namespace palpate::cli {
namespace {

/// "+3.1 % &plusmn; 2.0 %", "rms 3.7 %", "median 2.4 %", a line each.
std::string errors(const Score& score) {
  if (score.answers == 0) return "no answer";
  return number(score.bias_percent, "{:+.1f} %") + (std::isfinite(score.spread_percent) ? number(score.spread_percent, " &plusmn; {:.1f} %") : "") +
         number(score.rms_percent, "<br>rms {:.1f} %") + (score.answers > 1 ? number(score.median_percent, "<br>median {:.1f} %") : "") +
         (score.far_off > 0 ? fmt::format("<br>without {} off by a factor of ten and more: {}, rms {}", score.far_off,
                                          number(score.near_bias_percent, "{:+.1f} %"), number(score.near_rms_percent, "{:.1f} %"))
                            : "") +
         (score.without > 0 ? fmt::format("<br>{} of {} unanswered", score.without, score.asked) : "");
}

std::string apparent(const SceneAnswers& answers, MethodAnswer TrialAnswer::* method) {
  std::vector<const MethodAnswer*> all;
  for (const TrialAnswer& trial : answers.trials) all.push_back(&(trial.*method));
  return mean_and_std(spread_of(all)) + ", apparent";
}

/// One truth and what both methods found of it.
std::string seed_row(const std::string& name, const TrialAnswer& trial, double young_pa, const MethodAnswer& paper, const MethodAnswer& palpate,
                     bool truth_known) {
  const auto young = [&](const MethodAnswer& answer) {
    return truth_known ? of_truth(answer.young_modulus_pa, young_pa) : pascal(answer.young_modulus_pa);
  };
  std::string row = "<tr><td>" + name + "</td>";
  if (truth_known) row += fmt::format("<td>{}</td><td>{}</td>", pascal(young_pa), number(trial.poisson_ratio, "{:.3f}"));
  return row + fmt::format("<td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.1f}</td><td>{:.1f}</td>", young(paper),
                           number(paper.poisson_ratio, "{:.3f}"), young(palpate), interval(palpate), number(palpate.poisson_ratio, "{:.3f}"),
                           paper.seconds, palpate.seconds);
}

/// The first law's fit finds which samples count and where the tool slid: its seconds are the second one's, too.
MethodAnswer with_both_fits(const TrialAnswer& trial) {
  MethodAnswer out = counted(trial);
  if (!trial.other_law.empty()) out.seconds += trial.palpate.seconds;
  return out;
}

}  // namespace

std::string overview_table(const std::vector<SceneAnswers>& scenes) {
  std::string html = "<h2>The paper, its method here, and palpate</h2>\n<table><tr><th>scene</th><th>the paper reports</th><th>seeds</th>"
                     "<th>the paper's method here: E</th><th>palpate: E</th><th>in its 95 % intervals</th><th>s: the paper's method</th>"
                     "<th>s: palpate</th></tr>\n";
  for (const SceneAnswers& scene : scenes) {
    const SceneScores scores = scores_of(scene.trials);
    std::vector<const MethodAnswer*> paper, palpate;
    for (const TrialAnswer& trial : scene.trials) paper.push_back(&trial.paper), palpate.push_back(&counted(trial));
    const bool known = !scene.scene->apparent;
    const std::string of_law = scene.scene->other_law.empty() ? "" : fmt::format(" ({} law)", scene.scene->other_law);
    html += fmt::format("<tr><td><a href=\"#{}\">{}</a>{}</td><td class=\"words\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                        scene.scene->name, scene.scene->name, scene.scene->figures.empty() ? "" : fmt::format(" (fig. {})", scene.scene->figures),
                        scene.scene->paper_says, scene.trials.size(), known ? errors(scores.paper) : apparent(scene, &TrialAnswer::paper),
                        known ? errors(scores.palpate) + of_law : apparent(scene, &TrialAnswer::palpate),
                        known ? fmt::format("{} of {}", scores.palpate.inside_95, scores.palpate.asked) : "",
                        number(known ? scores.paper.seconds : spread_of(paper).seconds, "{:.1f}"),
                        number(known ? scores.palpate.seconds : spread_of(palpate).seconds, "{:.1f}"));
  }
  return html + "</table>\n<p class=\"small\">Errors of E: mean &plusmn; standard deviation of its logarithm over seeds (and sites), "
                "root mean square, and the median of its size. Seconds a seed, by the clock: medians.</p>\n";
}

std::string seed_table(const SceneAnswers& answers) {
  const bool known = !answers.scene->apparent;
  std::string html = fmt::format("<details><summary>All seeds one by one ({})</summary>\n<table><tr><th>seed</th>{}<th>the paper's method</th><th>its "
                                 "&nu;</th><th>palpate{}</th><th>95 %</th><th>its &nu;</th><th>s: the paper's method</th><th>s: palpate</th><th>s: "
                                 "truth, model, all</th></tr>\n",
                                 answers.trials.size(), known ? "<th>true E</th><th>true &nu;</th>" : "",
                                 answers.scene->other_law.empty() ? "" : fmt::format(", {} law", answers.scene->other_law));
  for (const TrialAnswer& trial : answers.trials) {
    const std::string all = fmt::format("<td>{:.0f}, {:.0f}, {:.0f}</td></tr>\n", trial.truth_s, trial.model_s, trial.total_s);
    const std::string failed = trial.failed.empty() ? "" : ", failed";
    if (trial.sites.empty())
      html += seed_row(fmt::format("{}{}", trial.seed, failed), trial, trial.young_modulus_pa, trial.paper, with_both_fits(trial), known) + all;
    for (const SiteAnswer& site : trial.sites)
      html += seed_row(fmt::format("{}, {}{}", trial.seed, site.site, failed), trial, site.young_modulus_pa, site.paper, site.palpate, known) +
              (&site == &trial.sites.front() ? all : "<td></td></tr>\n");
  }
  return html + "</table></details>\n";
}

}  // namespace palpate::cli
