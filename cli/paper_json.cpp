// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_json.hpp"

#include <algorithm>

namespace palpate::cli {
namespace {

nlohmann::json json_of(const MethodAnswer& answer) {
  return {{"young_modulus_pa", answer.young_modulus_pa}, {"lower_95_pa", answer.lower_95_pa}, {"upper_95_pa", answer.upper_95_pa},
          {"poisson_ratio", answer.poisson_ratio},       {"solves", answer.solves},           {"iterations", answer.iterations},
          {"seconds", answer.seconds},                   {"converged", answer.converged},     {"verdicts", answer.verdicts},
          {"poisson_lower_95", answer.poisson_lower_95}, {"poisson_upper_95", answer.poisson_upper_95},
          {"load_cases", answer.load_cases},             {"failed", answer.failed}};
}

nlohmann::json json_of(const TrialAnswer& trial) {
  nlohmann::json out = {{"seed", trial.seed},
                        {"true_young_modulus_pa", trial.young_modulus_pa},
                        {"true_poisson_ratio", trial.poisson_ratio},
                        {"tetrahedra", trial.tetrahedra},
                        {"truth_s", trial.truth_s},
                        {"model_s", trial.model_s},
                        {"total_s", trial.total_s},
                        {"paper", json_of(trial.paper)},
                        {"paper_linear_tetrahedra", json_of(trial.paper_coarse)},
                        {"palpate", json_of(trial.palpate)}};
  if (!trial.failed.empty()) out["failed"] = trial.failed;
  if (trial.left_out > 0) out["samples_left_out"] = trial.left_out;
  if (!trial.other_law.empty()) out["palpate_" + trial.other_law] = json_of(trial.other);
  for (const ForceReading& reading : trial.readings)
    out["readings"].push_back({{"push", reading.push}, {"force_n", reading.force_n}, {"travel_m", reading.travel_m}});
  for (const SiteAnswer& site : trial.sites)
    out["sites"].push_back({{"site", site.site},
                            {"true_young_modulus_pa", site.young_modulus_pa},
                            {"paper", json_of(site.paper)},
                            {"palpate", json_of(site.palpate)}});
  if (!trial.as_one_verdicts.empty()) out["verdicts_without_regions"] = trial.as_one_verdicts;
  for (const UnusedStep& step : trial.unused)
    out["unused_place"].push_back({{"force_n", step.force_n},
                                   {"travel_m", step.travel_m},
                                   {"force_paper_n", step.paper.force_n},
                                   {"force_palpate_n", step.palpate.force_n},
                                   {"force_other_law_n", step.other.force_n},
                                   {"surface_rms_m",
                                    {{"paper", step.paper.surface_m},
                                     {"palpate", step.palpate.surface_m},
                                     {"other_law", step.other.surface_m},
                                     {"still", step.surface_still_m}}},
                                   {"dent_rms_m",
                                    {{"paper", step.paper.dent_m},
                                     {"palpate", step.palpate.dent_m},
                                     {"other_law", step.other.dent_m},
                                     {"still", step.dent_still_m}}}});
  if (!trial.unused_stop.empty()) out["unused_place_not_pushed"] = trial.unused_stop;
  for (const StartAnswer& from : trial.starts)
    out["other_starts"].push_back({{"young_modulus_pa", from.young_modulus_pa},
                                   {"poisson_ratio", from.poisson_ratio},
                                   {"paper", json_of(from.paper)},
                                   {"palpate", json_of(from.palpate)}});
  for (const RegistrationPicture& picture : trial.pictures)
    out["registrations"].push_back({{"young_modulus_pa", picture.young_modulus_pa}, {"rms_m", picture.rms_m}});
  for (const SampleAnswer& sample : trial.samples)
    out["samples"].push_back({{"push", sample.push},
                              {"force_n", sample.force_n},
                              {"travel_m", sample.travel_m},
                              {"paper", json_of(sample.paper)},
                              {"palpate", json_of(sample.palpate)}});
  if (trial.surface.error_m2.size() > 0) {
    Eigen::Index row = 0, column = 0;
    out["grid_search"] = {{"smallest_m2", trial.surface.error_m2.minCoeff(&row, &column)}, {"at_found_m2", trial.surface.at_found_m2}};
    out["grid_search"]["smallest_at"] = {{"young_modulus_pa", trial.surface.young_modulus_pa(row)},
                                         {"poisson_ratio", trial.surface.poisson_ratio(column)}};
  }
  return out;
}

nlohmann::json json_of(const Foresight& one) {
  return {{"seeds", one.seeds}, {"force_bias_percent", one.force_bias_percent}, {"force_rms_percent", one.force_rms_percent}, {"dent_m", one.dent_m}};
}

nlohmann::json json_of(const Score& score) {
  return {{"asked", score.asked},                       {"without_answer", score.without},         {"with_interval", score.with_interval},
          {"bias_percent", score.bias_percent},         {"spread_percent", score.spread_percent},  {"rms_percent", score.rms_percent},
          {"median_percent", score.median_percent},
          {"far_off", score.far_off},                   {"near_bias_percent", score.near_bias_percent},
          {"near_rms_percent", score.near_rms_percent},
          {"poisson_bias", score.poisson_bias},         {"poisson_spread", score.poisson_spread},  {"poisson_rms", score.poisson_rms},
          {"inside_95", score.inside_95},               {"poisson_inside_95", score.poisson_inside_95},
          {"solves", score.solves},                     {"seconds", score.seconds},                {"most_load_cases", score.most_load_cases}};
}

}  // namespace

nlohmann::json json_of(const SceneAnswers& answers) {
  nlohmann::json out = {{"scene", answers.scene->name}, {"apparent_modulus", answers.scene->apparent}, {"trials", nlohmann::json::array()}};
  for (const TrialAnswer& trial : answers.trials) {
    out["trials"].push_back(json_of(trial));
    if (!answers.scene->apparent) continue;
    out["trials"].back().erase("true_young_modulus_pa");
    out["trials"].back().erase("true_poisson_ratio");
  }
  const SceneForesight foresight = foresight_of(answers.trials);
  out["predictions"] = {{"paper", json_of(foresight.paper)}, {"palpate", json_of(foresight.palpate)}, {"dent_if_nothing_moved_m", foresight.still_m}};
  if (answers.scene->apparent) return out;
  const SceneScores scores = scores_of(answers.trials);
  out["scores"] = {{"paper", json_of(scores.paper)},
                   {"paper_linear_tetrahedra", json_of(scores.paper_coarse)},
                   {"palpate", json_of(scores.palpate)},
                   {"palpate_with_the_papers_law", json_of(scores.palpate_with_the_papers_law)},
                   {"where_the_papers_method_answers",
                    {{"paper", json_of(scores.paper_compared)}, {"palpate", json_of(scores.palpate_compared)}, {"left_out", scores.apart}}}};
  return out;
}

nlohmann::json json_of(const StudyAnswer& answer) {
  nlohmann::json out = {{"study", answer.study->name}, {"seed", answer.seed}, {"seconds", answer.seconds}, {"rows", nlohmann::json::array()}};
  if (!answer.failed.empty()) out["failed"] = answer.failed;
  for (const StudyRow& row : answer.rows)
    out["rows"].push_back({{"what", row.what},
                           {"true_young_modulus_pa", row.young_modulus_pa},
                           {"true_poisson_ratio", row.poisson_ratio},
                           {"paper", json_of(row.paper)},
                           {"palpate", json_of(row.palpate)}});
  return out;
}

nlohmann::json json_of(std::span<const StudyAnswer> sorted) {
  nlohmann::json out = nlohmann::json::array();
  while (!sorted.empty()) {
    const auto end = std::find_if(sorted.begin(), sorted.end(), [&](const StudyAnswer& one) { return one.study != sorted.front().study; });
    const auto seeds = static_cast<std::size_t>(end - sorted.begin());
    out.push_back({{"study", sorted.front().study->name}, {"seeds", seeds}, {"rows", nlohmann::json::array()}});
    for (const StudyScore& row : scores_of(sorted.first(seeds)))
      out.back()["rows"].push_back({{"what", row.what}, {"paper", json_of(row.paper)}, {"palpate", json_of(row.palpate)}, {"verdicts", row.verdicts}});
    sorted = sorted.subspan(seeds);
  }
  return out;
}

}  // namespace palpate::cli
