// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/step_force.hpp"

#include <cmath>

namespace palpate::acquisition {
namespace {

using Samples = std::span<const sensing::ContactSample>;

/// force = mean + slope * (time - middle), least squares.
struct Line {
  double middle_s = 0, spread_s2 = 0;  // spread: sum of squared times from the middle
  Vec3 mean_n = Vec3::Zero(), slope_n_s = Vec3::Zero();
  double about_mean_n2 = 0, about_line_n2 = 0;  // variance of a sample, per axis
};

Line line_through(Samples samples) {
  Line line;
  const double count = static_cast<double>(samples.size());
  for (const auto& one : samples) line.middle_s += one.time_s / count, line.mean_n += one.force_n / count;
  for (const auto& one : samples) {
    const double t = one.time_s - line.middle_s;
    line.spread_s2 += t * t;
    line.slope_n_s += t * (one.force_n - line.mean_n);
  }
  if (line.spread_s2 > 0) line.slope_n_s /= line.spread_s2;
  for (const auto& one : samples) {
    const Vec3 off = one.force_n - line.mean_n;
    line.about_mean_n2 += off.squaredNorm() / 3;
    line.about_line_n2 += (off - line.slope_n_s * (one.time_s - line.middle_s)).squaredNorm() / 3;
  }
  if (count > 1) line.about_mean_n2 /= count - 1;
  if (count > 2) line.about_line_n2 /= count - 2;
  return line;
}

bool on_its_way(Samples samples, const Line& line) {
  constexpr std::size_t fewest = 8;
  constexpr double least_share = 0.01, least_errors = 10, alike = 0.5;
  if (samples.size() < fewest || !(line.spread_s2 > 0)) return false;
  const double slope = line.slope_n_s.norm(), change_n = slope * (samples.back().time_s - samples.front().time_s);
  if (change_n < least_share * line.mean_n.norm()) return false;
  if (slope < least_errors * std::sqrt(line.about_line_n2 / line.spread_s2)) return false;
  const std::size_t half = samples.size() / 2;
  const Vec3 bend = line_through(samples.first(half)).slope_n_s - line_through(samples.subspan(half)).slope_n_s;
  return bend.norm() < alike * slope;
}

}  // namespace

std::optional<StepForce> step_force(Samples samples, double seen_s) {
  if (samples.empty()) return std::nullopt;
  const Line line = line_through(samples);
  const double count = static_cast<double>(samples.size());
  StepForce out;
  if (on_its_way(samples, line)) {
    const double ahead_s = seen_s - line.middle_s;
    out.force_n = line.mean_n + ahead_s * line.slope_n_s;
    out.std_n = std::sqrt(line.about_line_n2 * (1 / count + ahead_s * ahead_s / line.spread_s2));
    out.rate_n_s = line.slope_n_s;
  } else {
    out.force_n = line.mean_n;
    out.std_n = std::sqrt(line.about_mean_n2 / count);
  }
  return out;
}

}  // namespace palpate::acquisition
