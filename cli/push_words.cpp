// SPDX-License-Identifier: Apache-2.0
#include "cli/push_words.hpp"

#include <fmt/format.h>

#include <cmath>

#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

constexpr double quantile_975 = 1.959963984540054;

nlohmann::json number(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(); }

}  // namespace

std::string percent_95(double log_std) {
  if (!std::isfinite(log_std)) return "-";
  return fmt::format("{:.1f} %", 100 * (std::exp(quantile_975 * log_std) - 1));
}

std::string plain_95(double std) { return std::isfinite(std) ? fmt::format("{:.3f}", quantile_975 * std) : "-"; }

std::string push_words(const estimation::RatedPush& push, const PushScene& scene) {
  const Vec3 &at = push.candidate.contact_m, &along = push.candidate.direction;
  std::string words = fmt::format("push at ({:.4f} {:.4f} {:.4f}) along ({:+.2f} {:+.2f} {:+.2f}) up to {} (about {})",
                                  at.x(), at.y(), at.z(), along.x(), along.y(), along.z(),
                                  report::quantity(push.force_n, "N"), report::quantity(push.travel_m, "m"));
  if (push.view >= 0 && scene.viewpoints.size() > 1) words += ", seen by " + scene.viewpoints[std::size_t(push.view)].name;
  return words;
}

nlohmann::json spread_json(const estimation::ExpectedSpread& spread) {
  return {{"log_young_std", number(spread.log_young_std)},
          {"young_modulus_within_95", number(std::exp(quantile_975 * spread.log_young_std) - 1)},
          {"poisson_std", number(spread.poisson_std)},
          {"poisson_ratio_within_95", number(quantile_975 * spread.poisson_std)}};
}

}  // namespace palpate::cli
