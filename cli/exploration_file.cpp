// SPDX-License-Identifier: Apache-2.0
#include "cli/exploration_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "cli/push_words.hpp"
#include "cli/truth_file.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

nlohmann::json moduli_json(const std::vector<Parameter>& young) {
  if (young.empty()) return {};
  if (young.size() == 1) return young.front().value;
  nlohmann::json regions;
  for (const Parameter& one : young) regions[one.region] = one.value;
  return regions;
}

}  // namespace

std::string moduli_words(const std::vector<Parameter>& young) {
  std::string words;
  for (const Parameter& one : young)
    words += fmt::format("{}{}{}{}", words.empty() ? "" : ", ", one.region, one.region.empty() ? "" : " ",
                         report::quantity(one.value, "Pa"));
  return words;
}

nlohmann::json json_of(const ExploredPush& push) {
  const auto& at = push.plan.candidate;
  const bool estimated = !push.young_moduli.empty();
  const auto if_known = [](bool known, auto value) { return known ? nlohmann::json(value) : nlohmann::json(); };
  return {{"push", push.name},
          {"earlier_run", push.earlier},
          {"contact_m", {at.contact_m.x(), at.contact_m.y(), at.contact_m.z()}},
          {"direction", {at.direction.x(), at.direction.y(), at.direction.z()}},
          {"stop", if_known(!push.earlier, acquisition::to_words(push.report.stop))},
          {"stop_message", if_known(!push.earlier, push.report.message)},
          {"highest_force_n", push.report.highest_force_n},
          {"deepest_m", push.report.deepest_m},
          {"pushes_planned", if_known(push.pushes_planned > 0, push.pushes_planned)},
          {"promised", spread_json(push.plan.expected)},
          {"found", spread_json(push.found)},
          {"young_modulus_pa", moduli_json(push.young_moduli)},
          {"young_modulus_within_95", if_known(estimated, young_modulus_half_width(push))},
          {"poisson_ratio", if_known(estimated, push.poisson_ratio.value)},
          {"poisson_ratio_within_95", if_known(estimated, poisson_ratio_half_width(push.poisson_ratio))}};
}

std::string words_of(const FixedLists& lists, int max_pushes) {
  const auto count = [&](const std::optional<int>& pushes) {
    return pushes ? std::to_string(*pushes) : fmt::format("more than {}", 10 * max_pushes);
  };
  return fmt::format("a list in random order over the same {} pushes is expected to need {}, the best place alone {}", lists.candidates,
                     count(lists.random), count(lists.repeated));
}

nlohmann::json json_of(const FixedLists& lists) {
  const auto count = [](const std::optional<int>& pushes) { return pushes ? nlohmann::json(*pushes) : nlohmann::json(); };
  return {{"candidates", lists.candidates}, {"random_order", count(lists.random)}, {"best_place_repeated", count(lists.repeated)}};
}

void ExplorationFile::go_on(const std::vector<Push>& recorded) {
  std::ifstream stream(file_);
  const nlohmann::json before = nlohmann::json::parse(stream, nullptr, false);
  if (!before.is_object() || !before.contains("pushes") || !before["pushes"].is_array()) return;
  for (nlohmann::json one : before["pushes"]) {
    if (!one.is_object() || !one.contains("push")) continue;
    const bool there = std::any_of(recorded.begin(), recorded.end(), [&](const Push& push) { return one["push"] == push.name; });
    if (!there) continue;
    one["earlier_run"] = true;
    told_.push_back(std::move(one));
  }
}

void ExplorationFile::add(const ExploredPush& push) {
  for (const nlohmann::json& one : told_)
    if (one["push"] == push.name) return;
  told_.push_back(json_of(push));
  write({{"format", "palpate-exploration/1"}, {"reached", false}, {"message", "not at its end, or cut off"}, {"pushes", told_}});
}

nlohmann::json ExplorationFile::pushes(const Explored& run) const {
  nlohmann::json all = nlohmann::json::array();
  for (const ExploredPush& push : run.pushes) {
    const auto told = std::find_if(told_.begin(), told_.end(), [&](const nlohmann::json& one) { return one["push"] == push.name; });
    all.push_back(told != told_.end() ? *told : json_of(push));
  }
  return all;
}

void ExplorationFile::write(const nlohmann::json& whole) const { write_json_aside(whole, file_); }

}  // namespace palpate::cli
