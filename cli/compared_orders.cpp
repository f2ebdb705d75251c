// SPDX-License-Identifier: Apache-2.0
#include "cli/compared_orders.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace palpate::cli {
namespace {

std::string words(const OrderedRun& run) { return fmt::format("{}{}", run.reached ? "" : "more than ", run.pushes); }

/// Runs that did not come to the goal come last: nobody knows how many they need.
std::vector<OrderedRun> sorted(std::vector<OrderedRun> runs) {
  std::sort(runs.begin(), runs.end(),
            [](const OrderedRun& a, const OrderedRun& b) { return std::pair(!a.reached, a.pushes) < std::pair(!b.reached, b.pushes); });
  return runs;
}

}  // namespace

std::string middle_words(std::vector<OrderedRun> runs) {
  if (runs.empty()) return "no lab";
  runs = sorted(std::move(runs));
  const OrderedRun& middle = runs[runs.size() / 2];
  return fmt::format("{} push{} in the middle of {} labs ({} to {})", words(middle), middle.pushes == 1 ? "" : "es", runs.size(),
                     words(runs.front()), words(runs.back()));
}

nlohmann::json by_seed_json(const std::string& order, const std::vector<OrderedRun>& runs) {
  nlohmann::json json = {{"order", order}, {"pushes", nlohmann::json::array()}, {"reached", nlohmann::json::array()}};
  for (const OrderedRun& run : runs) {
    json["pushes"].push_back(run.pushes);
    json["reached"].push_back(run.reached);
  }
  if (runs.empty()) return json;
  const OrderedRun middle = sorted(runs)[runs.size() / 2];
  json["middle"] = {{"pushes", middle.pushes}, {"reached", middle.reached}};
  return json;
}

}  // namespace palpate::cli
