// SPDX-License-Identifier: Apache-2.0
#include "cli/push_words.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

namespace palpate::cli {
namespace {

constexpr double quantile_975 = 1.959963984540054;

nlohmann::json number(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(); }

}  // namespace

std::string percent_95(double log_std) {
  constexpr double nothing = 1;  // known to a factor of seven at best
  if (!(log_std < nothing)) return "-";
  return fmt::format("{:.1f} %", 100 * (std::exp(quantile_975 * log_std) - 1));
}

std::string plain_95(double std) { return std::isfinite(std) ? fmt::format("{:.3f}", quantile_975 * std) : "-"; }

std::string stop_words(const acquisition::PushPlan& plan, const acquisition::PushReport& report, double start_distance_m) {
  if (report.stop != acquisition::StopReason::robot_limit) return report.message;
  const Vec3 at = plan.contact_m + Vec3::Zero(), along = plan.direction + Vec3::Zero();  // "+0.00", never "-0.00"
  return fmt::format("the robot refused to move {}: a limit, or out of reach. The push was to be at ({:.4f} {:.4f} {:.4f}) along "
                     "({:+.2f} {:+.2f} {:+.2f}), from {:.0f} mm before it; try another contact or direction, a shorter "
                     "--start-distance, or put the object elsewhere",
                     report.steps == 0 ? "there" : "on", at.x(), at.y(), at.z(), along.x(), along.y(), along.z(), 1000 * start_distance_m);
}

std::vector<std::string> push_warnings(const std::string& name, const acquisition::PushReport& report) {
  std::vector<std::string> out;
  if (report.blind_retreat_m)
    out.push_back(fmt::format("{}: how large the object is nobody said, so the arm went back {:.0f} mm along the tool and from there "
                              "straight past it; give the scene a shape (a box will do), or look at `--blind-retreat`",
                              name, 1000 * *report.blind_retreat_m));
  if (report.drift && report.steps > 0 && report.drift_n > 0.05 * report.highest_force_n)
    out.push_back(fmt::format("{}: the zero of the force moved by {:.3g} N during the push ({:.1f} N at most); taken off evenly over "
                              "its time. Let the sensor warm up, and keep cables from pulling",
                              name, report.drift_n, report.highest_force_n));
  if (report.turned_rad > 0.01)  // 1 N that a sensor reads by itself is then 10 mN aside
    out.push_back(fmt::format("{}: the tip was turned by up to {:.1f} degrees since the force was tared, and what a wrist sensor reads by itself "
                              "turns with it; let the robot keep the tip's whole orientation, also around the tool's axis",
                              name, report.turned_rad * 180 / std::numbers::pi));
  if (report.overshoot_n > 0.1 * (report.highest_force_n - report.overshoot_n))
    out.push_back(fmt::format("{}: the force passed its limit by {:.3g} N (to {:.3g} N): the object is stiffer than one motion foresees; "
                              "set a smaller --increment or --push-speed",
                              name, report.overshoot_n, report.highest_force_n));
  if (report.blank_images > 0)
    out.push_back(fmt::format("{}: {} of the camera's images held no depth at all and are left out; look whether the arm stands before the lens, "
                              "and at the camera's range",
                              name, report.blank_images));
  for (const int step : report.unsettled)
    out.push_back(fmt::format("step {} of {} had not settled when it was recorded", step, name));
  if (!report.came_back)
    out.push_back(fmt::format("{}: after the push {:.2f} % of the picture are not as before: the object has moved or did not come "
                              "back; hold it better, or push less",
                              name, 100 * report.changed_share));
  return out;
}

nlohmann::json spread_json(const estimation::ExpectedSpread& spread) {
  nlohmann::json json = {{"log_young_std", number(spread.log_young_std)},
                         {"young_modulus_within_95", number(std::exp(quantile_975 * spread.log_young_std) - 1)},
                         {"poisson_std", number(spread.poisson_std)},
                         {"poisson_ratio_within_95", number(quantile_975 * spread.poisson_std)}};
  if (spread.region_log_young_std.size() > 1)
    for (const double std : spread.region_log_young_std) json["region_log_young_std"].push_back(number(std));
  return json;
}

}  // namespace palpate::cli
